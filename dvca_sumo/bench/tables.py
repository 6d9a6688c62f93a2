"""Scores as text: for the terminal, and as a Markdown page. The paper's figures stand beside ours."""

from collections.abc import Callable, Sequence

import msgspec

from dvca_sumo.bench.paper import BY_SUITE, Figures
from dvca_sumo.bench.procedures import ProcedureSummary
from dvca_sumo.bench.score import FAILED, Score
from dvca_sumo.bench.summary import Summary, summary_of
from dvca_sumo.intervals import Share
from dvca_sumo.messages import COMPONENTS
from dvca_sumo.report.result import Json, versions

Rows = list[list[str]]
_Render = Callable[[str, Rows], str]

_TITLES = {"injected": "Injected faults", "real-bugs": "Real bugs", "random": "Random faults"}


class Gap(msgspec.Struct, frozen=True):
    """Cases that were asked for, and are not there."""

    missing: int
    reason: str

    def told(self, scores: Sequence[Score]) -> str:
        """The same in a line, of those that are there."""
        return f"NOT WHOLE: {len(scores)} of {len(scores) + self.missing} cases, {self.missing} missing: {self.reason}"


def summaries(scores: Sequence[Score]) -> list[Summary]:
    """One for each suite and mode, in the order of their first scores."""
    groups: dict[tuple[str, str], list[Score]] = {}
    for score in scores:
        groups.setdefault((score.suite, score.mode), []).append(score)
    return [summary_of(group) for group in groups.values()]


def json_of(scores: Sequence[Score], gap: Gap | None = None) -> Json:
    """The scores and what they come to, of JSON types only."""
    return {
        "schema": 1,
        "cases": msgspec.to_builtins(list(scores)),
        "missing": 0 if gap is None else gap.missing,
        "summary": msgspec.to_builtins(summaries(scores)),
        "versions": versions(),
    }


def terminal_text(scores: Sequence[Score], gap: Gap | None = None) -> str:
    """The tables for a terminal."""
    return _document(scores, gap, _plain)


def markdown_page(scores: Sequence[Score], gap: Gap | None = None) -> str:
    """The tables as a page of their own."""
    return "# Benchmark\n\n" + _document(scores, gap, _markdown) + "\n"


def _document(scores: Sequence[Score], gap: Gap | None, render: _Render) -> str:
    parts = [] if gap is None else [gap.told(scores)]
    for summary in summaries(scores):
        group = [score for score in scores if (score.suite, score.mode) == (summary.suite, summary.mode)]
        title = f"{_TITLES[summary.suite]}, {summary.mode} mode: {summary.cases} cases"
        parts += [
            render(title, _by_component(summary, group)),
            render("Cost of one attribution", _costs(summary)),
            *([render("What each idea buys", _procedures(summary))] if summary.procedures else []),
            render("Component: planted (rows), named (columns)", _confusion(summary)),
            *(["Wrong, and how to see it:\n" + _wrong(group)] if _wrong(group) else []),
            "Checks:\n" + "\n".join(f"- {'holds' if one.holds else 'FAILS'}: {one.text}" for one in summary.checks),
        ]
    return "\n\n".join(parts)


def _by_component(summary: Summary, scores: Sequence[Score]) -> Rows:
    theirs = BY_SUITE.get(summary.suite, {})
    head = ["component", "cases", "component right", "message right", "reduction", "of its messages", "by luck"]
    rows = [[*head, *(["paper: component", "message", "reduction"] if theirs else [])]]
    for component in COMPONENTS:
        group = [score for score in scores if score.expected_component == component]
        if group:
            ours = _figures(component.value, summary_of(group))
            rows.append([*ours, *(_paper(theirs[component]) if component in theirs else [])])
    return [*rows, [*_figures("all", summary), *([""] * 3 if theirs else [])]]


def _figures(name: str, summary: Summary) -> list[str]:
    return [
        name,
        str(summary.cases),
        _share(summary.components, has_interval=summary.suite == "random"),
        _share(summary.messages, has_interval=summary.suite == "random"),
        f"{summary.reduction_rate:.2%}",
        f"{summary.component_reduction_rate:.2%}",
        f"{summary.altered_share:.0%}",
    ]


def _paper(figures: Figures) -> list[str]:
    reduction = " to ".join(f"{rate:.1%}" for rate in dict.fromkeys(figures.reduction_rate))
    return [f"{figures.component_success:.0%}", f"{figures.message_success:.0%}", reduction]


def _costs(summary: Summary) -> Rows:
    rows = [["", "median", "worst", "probes"]]
    rows.append(
        ["ours", f"{summary.median_wall_s:.1f} s", f"{summary.worst_wall_s:.1f} s", f"{summary.probes:.1f} on average"]
    )
    if summary.suite in BY_SUITE:
        minutes = sorted(minute for figures in BY_SUITE[summary.suite].values() for minute in figures.minutes)
        rows.append(["paper", f"{minutes[0]:g} to {minutes[-1]:g} min on average", "", ""])
    return rows


def _procedures(summary: Summary) -> Rows:
    head = ["procedure", "component right", "message right", "probes", "simulated", "median", "worst"]
    return [head, *map(_procedure, summary.procedures)]


def _procedure(one: ProcedureSummary) -> list[str]:
    return [
        one.title,
        "is told" if one.components is None else _share(one.components, has_interval=False),
        "names none" if one.messages is None else _share(one.messages, has_interval=False),
        f"{one.probes:.1f}",
        f"{one.simulated_s:.0f} s",
        f"{one.median_wall_s:.1f} s",
        f"{one.worst_wall_s:.1f} s",
    ]


def _confusion(summary: Summary) -> Rows:
    named = [component.value for component in COMPONENTS]
    has_none = any("none" in found for found in summary.confusion.values())
    columns = [*named, "none"] if has_none else named
    rows = [["", *columns]]
    for expected in named:
        if expected in summary.confusion:
            found = summary.confusion[expected]
            rows.append([expected, *(str(found.get(column, 0)) for column in columns)])
    return rows


def _wrong(scores: Sequence[Score]) -> str:
    return "\n".join(f"- {score.name}: {_fault_of(score)}\n    {score.command}" for score in scores if _fault_of(score))


def _fault_of(score: Score) -> str:
    """What is wrong with one case, in a line; empty when nothing is."""
    if score.verdict == FAILED:
        return f"could not be analysed: {score.reason}"
    if not score.component_success:
        return f"{score.component or score.verdict} instead of {score.expected_component}: {score.reason}"
    if not score.message_success:
        away = "" if score.message_distance_s is None else f", {score.message_distance_s:.2f} s from the nearest"
        return f"the message is not one that the defect altered{away}"
    if score.is_proven is False:
        return "the reported message is not the last one that could have prevented it"
    if score.controls is not None and not score.controls.hold:
        said = {"without": "safe without the defect", "defective": "violates", "harmless": "harmless elsewhere"}
        broken = [text for name, text in said.items() if getattr(score.controls, name) is not True]
        return f"not shown: {', '.join(broken)}"
    return ""


def _share(share: Share, *, has_interval: bool) -> str:
    text = f"{share.count}/{share.total}"
    return f"{text} {share.value:.1%} ({share.low:.1%} to {share.high:.1%})" if has_interval else text


def _plain(title: str, rows: Rows) -> str:
    widths = [max(len(row[column]) for row in rows if column < len(row)) for column in range(len(rows[0]))]
    lines = ["  ".join(text.ljust(width) for text, width in zip(row, widths, strict=False)).rstrip() for row in rows]
    return "\n".join([title, *(f"  {line}" for line in lines)])


def _markdown(title: str, rows: Rows) -> str:
    width = len(rows[0])
    lines = ["| " + " | ".join([*row, *[""] * (width - len(row))]) + " |" for row in rows]
    return "\n".join([f"## {title}", "", lines[0], "|" + "---|" * width, *lines[1:]])
