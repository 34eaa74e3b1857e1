"""The one table that maps the library's names of settings to command-line flags."""

from __future__ import annotations

from grebe.core.errors import GrebeError

FLAGS = {
    "apart_m": "--apart",
    "boats": "--boats",
    "bollard_n": "--bollard",
    "battery_reserve": "--battery-reserve",
    "battery_wh": "--battery-wh",
    "cell_m": "--cell",
    "clock_offset_s": "--clock-offset",
    "coast_tolerance_m": "--coast-tolerance",
    "columns": "--column",
    "core": "--core",
    "energy_wh": "--wh",
    "every_s": "--every",
    "feature": "--feature",
    "force": "--force",
    "goal": "--goal",
    "header_from": "--header-from",
    "instrument": "--instrument",
    "method": "--method",
    "home": "--home",
    "until_sd": "--until-sd",
    "link": "--link",
    "live": "--live",
    "certificate": "--certificate",
    "password_file": "--password-file",
    "name": "--name",
    "max_minutes": "--max-minutes",
    "minutes": "--minutes",
    "moment": "--moment",
    "pattern": "--pattern",
    "piece_s": "--piece",
    "profile": "--profile",
    "credits_file": "--credits",
    "quantities": "--quantities",
    "port": "--port",
    "radius_m": "--radius",
    "rate_hz": "--rate",
    "resume": "--resume",
    "range_m": "--range",
    "scheduler": "--scheduler",
    "sd_share": "--sd",
    "reserve": "--reserve",
    "harbours": "--harbour",
    "sortie": "--sortie",
    "starts": "--start",
    "together": "--together",
    "threshold": "--threshold",
    "sortie_battery_wh": "--battery",
    "sortie_minutes": "--sortie-minutes",
    "seasonal": "--seasonal",
    "servos": "--servos",
    "shape": "--shape",
    "shore_depth_sd_m": "--shore-depth-sd",
    "shore_margin_m": "--shore-margin",
    "speed": "--speed",
    "speed_max_mps": "--speed-limit",
    "until": "--until",
    "vessel": "--vessel",
    "zone": "--zone",
    "workers": "--workers",
}


def sentence(error: GrebeError) -> str:
    """An error's message, followed by the flags of the settings that it names."""
    flags = ", ".join(FLAGS[name] for name in error.settings)
    return f"{error} ({flags})" if flags else str(error)
