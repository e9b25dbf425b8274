//! The `hgm` program; everything it does lives in `hgm::cli`.

fn main() -> std::process::ExitCode {
    hgm::cli::main()
}
