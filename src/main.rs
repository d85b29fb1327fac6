//! The program `hairbake`; see [`hairbake::cli`].

fn main() -> std::process::ExitCode {
    hairbake::cli::main()
}
