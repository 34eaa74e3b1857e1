"""grebe instruments: list the sondes that Grebe can read, watch one, or simulate one."""

from __future__ import annotations

import json
import time

import click

from grebe.cli import options, output
from grebe.core.errors import UsageError
from grebe.links.base import Reading


@click.command(name="instruments")
@click.argument("instrument", required=False, metavar="[ADDRESS@PROFILE]")
@click.option(
    "--seconds",
    type=click.FloatRange(min=0, min_open=True),
    help="How long to listen.  [default: until Ctrl-C]",
)
@click.option("--pretend", metavar="PROFILE", help="Simulate a sonde of this kind, to rehearse.")
@click.option(
    "--to", "address", help="With --pretend: HOST:PORT to send to, instead of a serial line."
)
@options.json_option
def command(
    instrument: str | None,
    seconds: float | None,
    pretend: str | None,
    address: str | None,
    as_json: bool,
) -> None:
    """List the instruments that Grebe can read, watch one, or simulate one.

    ADDRESS is serial:DEVICE[:BAUD], udp:HOST:PORT, tcp:HOST:PORT or file:PATH. PROFILE is one of
    the list, or a TOML file of your own.
    """
    if instrument and pretend:
        raise UsageError("Give either an instrument to watch or --pretend, not both.")
    if pretend:
        _pretend(pretend, address, seconds)
    elif instrument:
        _watch(instrument, seconds, as_json=as_json)
    else:
        _list(as_json=as_json)


def _list(*, as_json: bool) -> None:
    from grebe.links.instruments.profile import profile_named, profile_names

    profiles = {name: profile_named(name) for name in profile_names()}
    if as_json:
        rows = [
            {"name": name, "title": one.title, "quantities": list(one.keys), "source": one.source}
            for name, one in profiles.items()
        ]
        click.echo(json.dumps(rows))
        return
    width = max(map(len, profiles))
    for name, one in profiles.items():
        click.echo(f"  {name:<{width}}  {one.title}")
    click.echo("Next: grebe instruments serial:/dev/ttyUSB0@PROFILE")


def _watch(instrument: str, seconds: float | None, *, as_json: bool) -> None:
    from grebe.workflow.instruments import watch_instrument

    def show(reading: Reading) -> None:
        if as_json:
            click.echo(json.dumps({"age_s": round(reading.age_s, 3), **reading.values}))
            return
        values = "  ".join(f"{key} {value:.6g}" for key, value in reading.values.items())
        click.echo(f"{reading.age_s:6.2f} s ago  {values}")

    output.note(watch_instrument(instrument, show, output.note, seconds=seconds))


def _pretend(profile: str, address: str | None, seconds: float | None) -> None:
    from grebe.links.instruments.pretend import PretendSerial, PretendUdp, simulated_instrument
    from grebe.links.instruments.profile import profile_named

    voice = simulated_instrument(profile_named(profile))
    sonde = PretendUdp(voice, address) if address else PretendSerial(voice)
    where = f"udp:{address}" if address else f"serial:{getattr(sonde, 'device', '')}:9600:8N1"
    output.note(f"A simulated sonde is sending; read it with: grebe instruments {where}@{profile}")
    try:
        time.sleep(seconds if seconds is not None else 1e9)
    finally:
        sonde.close()
