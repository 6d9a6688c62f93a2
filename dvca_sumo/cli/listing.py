"""`dvca-sumo faults`: what can be planted."""

import click

from dvca_sumo.cli.output import deliver
from dvca_sumo.interventions import COMMON, Parameter, fault_library
from dvca_sumo.stack.bugs import BUGS


@click.command()
def faults() -> None:
    """List the fault library (name, component, parameters with units), and the real bugs."""
    lines = []
    for name, entry in fault_library().items():
        lines += [f"{name}  ({entry.component.value})", f"    {entry.summary}"]
        lines += [f"    {_described(key, parameter)}" for key, parameter in entry.parameters.items()]
    lines += ["every fault", *(f"    {_described(key, parameter)}" for key, parameter in COMMON.items())]
    lines.append("real bugs, for --bug")
    for name, bug in BUGS.items():
        lines += [f"{name}  ({bug.component.value})", f"    {bug.summary}", f"    {bug.source}"]
    deliver("\n".join(lines), {})


def _described(key: str, parameter: Parameter) -> str:
    allowed = f", {parameter.low:g} to {parameter.high:g}" if parameter.kind == "number" else ""
    unit = f" [{parameter.unit}{allowed}]" if parameter.unit else ""
    default = f"default {parameter.default}" if parameter.default != "" else "unset by default"
    return f"{key:<8}{unit} {parameter.summary} ({default})"
