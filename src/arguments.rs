//! What every program prints about its own arguments: what is wrong with them, completion for shells, and a man page.

use crate::text::print_error;
use clap::{Args, Command};
use clap_complete::Shell;

/// Prints why there are no arguments, which may be a question for help; the status to end with.
pub fn explained(error: &clap::Error) -> u8 {
    if error.use_stderr() {
        print_error(error.render().to_string().trim_end());
        return 2;
    }
    let _ = error.print();
    0
}

/// Options that print and do nothing else.
#[derive(Args, Clone, Copy, Debug, Default)]
pub struct About {
    /// Print what a shell needs to complete the arguments of this program
    #[arg(long, value_name = "SHELL", exclusive = true)]
    completion: Option<Shell>,
    /// Print the manual page of this program: `... --man | man -l -`
    #[arg(long, exclusive = true)]
    man: bool,
}

impl About {
    /// The text that is asked for, if one is.
    pub fn text(self, mut command: Command) -> Option<String> {
        let mut text = Vec::new();
        if let Some(shell) = self.completion {
            let name = command.get_name().to_owned();
            clap_complete::generate(shell, &mut command, name, &mut text);
        } else if self.man {
            // A vector takes all.
            let _ = clap_mangen::Man::new(command).render(&mut text);
        } else {
            return None;
        }
        Some(String::from_utf8_lossy(&text).into_owned())
    }
}
