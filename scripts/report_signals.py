"""Ctrl-C, SIGTERM and SIGHUP for the report scripts. To be set before the libraries are loaded, which takes a
second."""
import os
import signal
import sys

_loading = True


def loaded():
    """The libraries are there: what is begun from now on has to be removed."""
    global _loading
    _loading = False


def end_on_signals(name):
    """One line on stderr, exit status 128 + signal; `finally` removes what was begun. A signal that is ignored stays
    ignored."""

    def end(number, _):
        for other in (signal.SIGINT, signal.SIGTERM, signal.SIGHUP):
            signal.signal(other, signal.SIG_IGN)  # one way out is enough
        os.write(2, "{}: interrupted; nothing unfinished is left behind\n".format(name).encode())
        if _loading:  # where an exception may get lost: some run in __del__ or in what catches all
            os._exit(128 + number)
        sys.exit(128 + number)

    for number in (signal.SIGINT, signal.SIGTERM, signal.SIGHUP):
        if signal.getsignal(number) != signal.SIG_IGN:
            signal.signal(number, end)
