"""`dvca-sumo faults`: what can be planted."""

import click

from dvca_sumo.interventions import COMMON, Parameter, fault_library
from dvca_sumo.stack.bugs import BUGS


@click.command()
def faults() -> None:
    """List the fault library (name, component, parameters with units), and the real bugs."""
    for name, entry in fault_library().items():
        click.echo(f"{name}  ({entry.component.value})\n    {entry.summary}")
        for key, parameter in entry.parameters.items():
            click.echo(f"    {_described(key, parameter)}")
    click.echo("every fault")
    for key, parameter in COMMON.items():
        click.echo(f"    {_described(key, parameter)}")
    click.echo("real bugs, for --bug")
    for name, bug in BUGS.items():
        click.echo(f"{name}  ({bug.component.value})\n    {bug.summary}\n    {bug.source}")


def _described(key: str, parameter: Parameter) -> str:
    allowed = f", {parameter.low:g} to {parameter.high:g}" if parameter.kind == "number" else ""
    unit = f" [{parameter.unit}{allowed}]" if parameter.unit else ""
    default = f"default {parameter.default}" if parameter.default != "" else "unset by default"
    return f"{key:<8}{unit} {parameter.summary} ({default})"
