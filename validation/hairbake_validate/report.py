"""Findings, the checks they belong to, and how both are told: a table for people, JSON for programs."""

from dataclasses import dataclass, field
from enum import Enum

SHOWN = 5
"""Findings of one check that are listed; the rest are counted."""


class Severity(Enum):
    """What a broken check does to the verdict."""

    ERROR = "error"
    WARNING = "warning"


@dataclass(frozen=True)
class Check:
    """One thing that is checked. `tolerance` is 0 for what is simply right or wrong; `unit` is that of
    the tolerance and of the findings' values.
    """

    id: str
    description: str
    tolerance: float = 0.0
    unit: str = "faults"
    severity: Severity = Severity.ERROR


@dataclass(frozen=True)
class Finding:
    """What a check saw in one place. A fault without a measure has the value 1."""

    check: Check
    value: float = 1.0
    message: str = ""
    frame: int | None = None
    prim: str | None = None
    curve: int | None = None

    @property
    def broken(self) -> bool:
        """Whether the check's tolerance is exceeded; a value that is no number is."""
        return not self.value <= self.check.tolerance

    def place(self) -> str:
        """Frame, prim and curve, as far as known."""
        parts = [
            f"frame {self.frame}" if self.frame is not None else "",
            self.prim or "",
            f"curve {self.curve}" if self.curve is not None else "",
        ]
        return ", ".join(part for part in parts if part)


@dataclass
class Outcome:
    """All that one check found."""

    check: Check
    ran: bool = False
    worst: Finding | None = None
    broken: list[Finding] = field(default_factory=list)

    @property
    def status(self) -> str:
        """`pass`, `fail`, `warn` (broken, but a warning) or `skip`."""
        if not self.ran:
            return "skip"
        if not self.broken:
            return "pass"
        return "fail" if self.check.severity is Severity.ERROR else "warn"

    def add(self, finding: Finding) -> None:
        """Takes a finding in."""
        if self.worst is None or not finding.value <= self.worst.value:
            self.worst = finding
        if finding.broken:
            self.broken.append(finding)

    def as_json(self) -> dict:
        """The check's entry in the JSON report."""
        worst = self.worst
        return {
            "id": self.check.id,
            "description": self.check.description,
            "status": self.status,
            "severity": self.check.severity.value,
            "tolerance": self.check.tolerance,
            "unit": self.check.unit,
            "worst": worst.value if worst else None,
            "frame": worst.frame if worst else None,
            "prim": worst.prim if worst else None,
            "curve": worst.curve if worst else None,
            "faults": len(self.broken),
            "messages": [describe(finding) for finding in self.broken[:SHOWN]],
        }


class Report:
    """The outcome of every check on one cache."""

    def __init__(self, cache: str, checks: list[Check]):
        self.cache = cache
        self.outcomes = {check.id: Outcome(check) for check in checks}

    def ran(self, checks: list[Check]) -> None:
        """Notes that these checks were carried out, so that silence means they pass."""
        for check in checks:
            self.outcomes[check.id].ran = True

    def add(self, findings: list[Finding]) -> None:
        """Takes findings in."""
        for finding in findings:
            self.outcomes[finding.check.id].add(finding)

    @property
    def passed(self) -> bool:
        """Whether no check of severity error is broken."""
        return all(outcome.status != "fail" for outcome in self.outcomes.values())

    def as_json(self) -> dict:
        """The whole report as plain data."""
        return {
            "format": "hairbake-validation",
            "version": 1,
            "cache": self.cache,
            "passed": self.passed,
            "checks": [outcome.as_json() for outcome in self.outcomes.values()],
        }

    def as_text(self) -> str:
        """The report as a table."""
        lines = []
        for outcome in self.outcomes.values():
            check, worst = outcome.check, outcome.worst
            measure = ""
            if check.unit == "faults":
                measure = f"{len(outcome.broken)} faults" if outcome.broken else ""
            elif worst:
                measure = f"{worst.value:.3g} of {check.tolerance:.3g} {check.unit}"
            place = worst.place() if worst else ""
            lines.append(f"{outcome.status:<5} {check.id:<18} {measure:<32} {place}".rstrip())
            lines += [f"        {describe(finding)}" for finding in outcome.broken[:SHOWN]]
            if len(outcome.broken) > SHOWN:
                lines.append(f"        and {len(outcome.broken) - SHOWN} more")
        counts = [outcome.status for outcome in self.outcomes.values()]
        tally = ", ".join(
            f"{counts.count(status)} {status}"
            for status in ("pass", "warn", "fail", "skip")
            if status in counts
        )
        lines.append(f"{self.cache}: {'passed' if self.passed else 'FAILED'} ({tally})")
        return "\n".join(lines)


def describe(finding: Finding) -> str:
    """One finding as a line."""
    place = finding.place()
    text = finding.message or f"{finding.value:.3g} {finding.check.unit}"
    return f"{place}: {text}" if place else text
