//! Common command-line parts of all programs: printing, completion for shells, and man pages.

use crate::text::{print_error, printable};
use clap::{Args, Command};
use clap_complete::Shell;
use signal_hook::consts::SIGXFSZ;
use std::io::{self, Write as _};
use std::path::PathBuf;
use std::process::ExitCode;
use std::sync::Arc;

/// Exit status of a program with wrong arguments, or that could not print its output.
pub const WRONG: u8 = 2;
/// Exit status of a failed run.
pub const FAILED: u8 = 1;
/// Exit status of a run that a signal stopped, and that can continue.
pub const STOPPED: u8 = 3;
/// Exit status of a stage that is over without reaching its `[stop]`.
pub const UNMET: u8 = 4;

/// Prints to standard output in one piece. A reader that stops early, such as `head`, is no error; a full disk is.
///
/// # Errors
/// The error of the system.
pub fn print(text: &str) -> io::Result<()> {
    let mut output = io::stdout().lock();
    match output.write_all(printable(text).as_bytes()).and_then(|()| output.flush()) {
        Err(error) if error.kind() != io::ErrorKind::BrokenPipe => Err(error),
        _ => Ok(()),
    }
}

/// Prints like [`print`]; reports an error in the name of the program.
///
/// # Errors
/// The exit status.
pub fn print_or_tell(program: &str, text: &str) -> Result<(), ExitCode> {
    print(text).map_err(|error| {
        let _ = writeln!(io::stderr(), "{program}: cannot write to standard output: {error}");
        ExitCode::from(WRONG)
    })
}

/// Prints the text of `--help`, `--version` or wrong arguments, and returns the exit status.
pub fn ended_by(error: &clap::Error) -> u8 {
    if error.use_stderr() {
        print_error(error.render().to_string().trim_end());
        return WRONG;
    }
    match error.print().and_then(|()| io::stdout().flush()) {
        Err(error) if error.kind() != io::ErrorKind::BrokenPipe => {
            let _ = writeln!(io::stderr(), "cannot write to standard output: {error}");
            WRONG
        }
        _ => 0,
    }
}

/// Lets a write beyond the largest allowed file (`ulimit -f`) fail with an error. Otherwise the system ends the process
/// without a message, and leaves half a file.
pub fn outlive_limits_of_files() {
    let _ = signal_hook::flag::register(SIGXFSZ, Arc::default());
}

/// Options that print and do nothing else.
#[derive(Args, Clone, Copy, Debug, Default)]
pub struct About {
    /// Print the completion of the arguments of this program for a shell
    #[arg(long, value_name = "SHELL", exclusive = true)]
    completion: Option<Shell>,
    /// Print the manual page of this program: `... --man | man -l -`
    #[arg(long, exclusive = true)]
    man: bool,
}

impl About {
    /// The requested text, if any.
    pub fn text(self, mut command: Command) -> Option<String> {
        let mut text = Vec::new();
        if let Some(shell) = self.completion {
            let name = command.get_name().to_owned();
            clap_complete::generate(shell, &mut command, name, &mut text);
        } else if self.man {
            // Writing to a vector cannot fail.
            let _ = clap_mangen::Man::new(command).render(&mut text);
        } else {
            return None;
        }
        Some(String::from_utf8_lossy(&text).into_owned())
    }
}

/// The command line of this process, as typed into a shell; the program by its name alone.
pub fn command_line() -> String {
    let quoted = |word: String| {
        let is_plain = |c: char| c.is_alphanumeric() || "-_./=:,+@%".contains(c);
        if !word.is_empty() && word.chars().all(is_plain) {
            return word;
        }
        format!("'{}'", word.replace('\'', r"'\''"))
    };
    let mut words = std::env::args_os();
    let program = words.next().map(PathBuf::from).unwrap_or_default();
    let name = program.file_name().unwrap_or_default().to_string_lossy().into_owned();
    let words = words.map(|word| word.to_string_lossy().into_owned());
    std::iter::once(name).chain(words).map(quoted).collect::<Vec<_>>().join(" ")
}
