"""The files of a diagnosis: JSON first, then the model, then the page."""

from __future__ import annotations

from pathlib import Path

from ..diagnosis.answer.extended_model import write_extended_model
from ..diagnosis.answer.output import EXTENDED_MODEL
from ..diagnosis.findings import Findings
from ..json_values import json_text
from ..model.files import write_text
from .diagnosis_page import diagnosis_page
from .html import write_report

JSON_NAME, REPORT_NAME = 'diagnosis.json', 'report.html'


def write_answer(answer: Findings, robot_file: str, folder: Path) -> None:
    """Write what was found, the extended model and the page.

    Args:
        answer: What was found.
        robot_file: The file that the model extends.
        folder: Where they belong; made where it is missing.

    Raises:
        ConfigurationError: they can't be written.
    """
    write_text(folder / JSON_NAME, json_text(answer.to_dict()))
    extension = (*answer.extension, *answer.events)
    write_extended_model(robot_file, extension, folder / EXTENDED_MODEL)
    write_report(diagnosis_page(answer), folder / REPORT_NAME)
