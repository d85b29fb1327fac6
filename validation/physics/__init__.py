"""Physics of hairbake's rod held against independent solutions: studies, references, and the page that shows them."""
