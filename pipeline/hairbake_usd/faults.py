"""What is wrong with a file, in the words that `hairbake` puts before a person."""

from dataclasses import dataclass


@dataclass(frozen=True)
class Fault:
    """One fault: where (a prim or attribute path), what was found, what is allowed, and what to do."""

    key: str
    what: str
    allowed: str
    remedy: str


class Faults(Exception):
    """All faults of a file."""

    def __init__(self, *faults: Fault):
        super().__init__("; ".join(f"{fault.key}: {fault.what}" for fault in faults))
        self.faults = list(faults)


def fail(key, what: str, allowed: str, remedy: str) -> Faults:
    """A single fault, to be raised."""
    return Faults(Fault(str(key), what, allowed, remedy))
