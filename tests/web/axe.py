"""The audit of a page by axe, as it is shown now."""

from pathlib import Path

from playwright.sync_api import Page

AXE = Path(__file__).resolve().parents[2] / "web/node_modules/axe-core/axe.min.js"


def faults(page: Page) -> list[str]:
    """What axe finds in either theme, as 'theme: rule: element'."""
    page.emulate_media(reduced_motion="reduce")  # colours on their way from one theme to the other are no fault
    page.add_script_tag(path=AXE)
    return [fault for theme in ("dark", "light") for fault in _faults_in(page, theme)]


def _faults_in(page: Page, theme: str) -> list[str]:
    found = page.evaluate(
        "async theme => ((document.documentElement.dataset.theme = theme), (await axe.run()).violations)", theme
    )
    faults = ((fault, node) for fault in found for node in fault["nodes"])
    return [f"{theme}: {fault['id']}: {node['html']} {node['failureSummary']}" for fault, node in faults]
