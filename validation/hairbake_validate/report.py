"""Checks, their findings, and the report: a table for people and JSON for programs."""

from collections.abc import Iterable
from dataclasses import dataclass, field
from enum import Enum
from typing import Any

SHOWN = 5
"""Findings listed for one check; further ones are counted."""


class Severity(Enum):
    """Effect of a broken check on the verdict."""

    ERROR = "error"
    WARNING = "warning"


@dataclass(frozen=True)
class Check:
    """A property that every cache must have."""

    id: str
    """Name, stable between versions."""
    description: str
    """The property."""
    help: str
    """What to do where it is broken: imperative, lower case, no full stop."""
    tolerance: float = 0.0
    """Largest value that passes; 0 for a property that either holds or does not."""
    unit: str = "faults"
    """Unit of the tolerance and of the values of findings."""
    severity: Severity = Severity.ERROR

    @property
    def counts(self) -> bool:
        """True if findings have no measure and are counted."""
        return self.unit == "faults"


@dataclass(frozen=True)
class Finding:
    """The result of a check at one place."""

    check: Check
    value: float = 1.0
    """Measure in the unit of the check; 1 for a defect without a measure."""
    message: str = ""
    frame: int | None = None
    prim: str | None = None
    curve: int | None = None

    @property
    def broken(self) -> bool:
        """True if the value exceeds the tolerance or is NaN."""
        return not self.value <= self.check.tolerance

    def place(self) -> str:
        """Frame, prim and curve, as far as they are known."""
        parts = [
            f"frame {self.frame}" if self.frame is not None else "",
            self.prim or "",
            f"curve {self.curve}" if self.curve is not None else "",
        ]
        return ", ".join(part for part in parts if part)


@dataclass
class Outcome:
    """All findings of one check."""

    check: Check
    ran: bool = False
    worst: Finding | None = None
    broken: list[Finding] = field(default_factory=list)

    @property
    def status(self) -> str:
        """`pass`, `fail`, `warn` (broken, of severity warning) or `skip`."""
        if not self.ran:
            return "skip"
        if not self.broken:
            return "pass"
        return "fail" if self.check.severity is Severity.ERROR else "warn"

    def add(self, finding: Finding) -> None:
        """Adds a finding."""
        if self.worst is None or not finding.value <= self.worst.value:
            self.worst = finding
        if finding.broken:
            self.broken.append(finding)

    def as_json(self) -> dict[str, Any]:
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

    def as_lines(self) -> list[str]:
        """The check's lines in the text report: status, worst value and its place; findings; help."""
        measure = ""
        if self.check.counts:
            measure = f"{len(self.broken)} found" if self.broken else ""
        elif self.worst:
            measure = f"{self.worst.value:.3g} of {self.check.tolerance:.3g} {self.check.unit}"
        place = self.worst.place() if self.worst else ""
        lines = [f"{self.status:<5} {self.check.id:<22} {measure:<32} {place}".rstrip()]
        lines += [f"        {describe(finding)}" for finding in self.broken[:SHOWN]]
        if len(self.broken) > SHOWN:
            lines.append(f"        and {len(self.broken) - SHOWN} more")
        if self.broken:
            lines.append(f"        help: {self.check.help}")
        return lines


class Report:
    """The outcome of every check on one cache."""

    def __init__(self, cache: str, checks: list[Check]) -> None:
        """A report in which no check has run."""
        self.cache = cache
        self.outcomes = {check.id: Outcome(check) for check in checks}

    def ran(self, checks: Iterable[Check]) -> None:
        """Marks checks as run: without findings they pass."""
        for check in checks:
            self.outcomes[check.id].ran = True

    def add(self, findings: list[Finding]) -> None:
        """Adds findings to their checks."""
        for finding in findings:
            self.outcomes[finding.check.id].add(finding)

    @property
    def passed(self) -> bool:
        """True if no check of severity error is broken."""
        return all(outcome.status != "fail" for outcome in self.outcomes.values())

    def as_json(self) -> dict[str, Any]:
        """The report as plain data."""
        return {
            "format": "hairbake-validation",
            "version": 1,
            "cache": self.cache,
            "passed": self.passed,
            "checks": [outcome.as_json() for outcome in self.outcomes.values()],
        }

    def as_text(self) -> str:
        """The report as a table, with the verdict in its last line."""
        lines = [line for outcome in self.outcomes.values() for line in outcome.as_lines()]
        statuses = [outcome.status for outcome in self.outcomes.values()]
        tally = ", ".join(
            f"{statuses.count(status)} {status}"
            for status in ("pass", "warn", "fail", "skip")
            if status in statuses
        )
        lines.append(f"{self.cache}: {'passed' if self.passed else 'FAILED'} ({tally})")
        return "\n".join(lines)


def describe(finding: Finding) -> str:
    """One finding on one line: its place, and its message or its value with the tolerance."""
    check, place = finding.check, finding.place()
    text = finding.message or f"{finding.value:.3g} {check.unit}, allowed {check.tolerance:.3g}"
    return f"{place}: {text}" if place else text
