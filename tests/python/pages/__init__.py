"""The Markdown files of the repository."""
