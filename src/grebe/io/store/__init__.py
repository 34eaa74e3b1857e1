"""The survey file: one GeoPackage that opens in QGIS while the mission runs."""

from grebe.io.store.survey_file import SCHEMA_VERSION, SurveyFile
from grebe.io.store.tables import Progress, TrackTable

__all__ = ["SCHEMA_VERSION", "Progress", "SurveyFile", "TrackTable"]
