"""``clutchid --install-completion``: completion of commands and options by the shell."""

from __future__ import annotations

from typing import Annotated, Literal

from cyclopts import App, Parameter

from clutchid.cli.common import DONE, guarded, print_written
from clutchid.documents.console import put
from clutchid.errors import ExportError, ParameterError

Shell = Literal["zsh", "bash", "fish", "powershell"]


def register_completion(application: App) -> None:
    """Add ``--install-completion`` to the commands of `application`."""

    @guarded
    def install_completion(
        shell: Annotated[Shell | None, Parameter(name="--shell")] = None,
        debug: Annotated[bool, Parameter(name="--debug", negative="")] = False,
    ) -> int:
        """Let the Tab key of your shell complete the commands and options of clutchid.

        Writes a script into your home folder; for bash, zsh and PowerShell adds a line that loads it to the start file
        of the shell (.bashrc, .zshrc, the profile). Repeat it after an update of clutchid.

        Parameters
        ----------
        shell
            The shell; by default the one that you are using.
        debug
            Show the traceback of an error.
        """
        return _install(application, shell)

    application.command(install_completion, name="--install-completion")


def _install(application: App, shell: Shell | None) -> int:
    from cyclopts.completion.detect import ShellDetectionError, detect_shell

    try:
        used = shell or detect_shell()
    except ShellDetectionError as error:
        raise ParameterError(
            "your shell could not be identified; name it: clutchid --install-completion --shell bash (or zsh, "
            "fish, powershell)."
        ) from error
    try:
        path = application.install_completion(shell=used)
    except OSError as error:
        where = f"{error.filename}: " if error.filename else ""
        raise ExportError(f"{where}{error.strerror}; the completion for {used} was not installed.") from error
    print_written(path)
    put(f"Open a new terminal, and press Tab behind `clutchid` there: {used} completes it.")
    return DONE
