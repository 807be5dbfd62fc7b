"""Where `CI` is set, all that a test may need is installed: a test or file that skips itself fails there."""

import pytest


class NothingMissing:
    """Plugin that turns skips into failures, but for those of a mark, such as `skipif`, whose condition is no want."""

    @pytest.hookimpl(wrapper=True)
    def pytest_runtest_makereport(self, item):
        report = yield
        if not hasattr(report, "wasxfail") and not any(item.iter_markers("skipif")):
            _fail_if_skipped(report)
        return report

    @pytest.hookimpl(wrapper=True)
    def pytest_make_collect_report(self):
        report = yield
        _fail_if_skipped(report)
        return report


def _fail_if_skipped(report):
    if report.skipped:
        _, _, reason = report.longrepr
        report.outcome, report.longrepr = "failed", f"{reason}; where CI is set, nothing may be skipped for want of it"
