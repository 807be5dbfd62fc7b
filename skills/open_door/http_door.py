"""Doors that open by an HTTP call."""

from dataclasses import dataclass
from typing import Annotated
from urllib.error import HTTPError
from urllib.request import Request, urlopen

from pydantic import Field

from skills.quantities import Duration

Url = Annotated[str, Field(pattern=r"^https?://[^\s/]+\S*$")]
Method = Annotated[str, Field(pattern="^(GET|POST|PUT|PATCH)$")]


@dataclass(frozen=True)
class HttpDoor:
    """Door that opens by one HTTP call; any answer of 200 to 299 within `timeout_s` counts."""

    url: Url
    method: Method = "POST"
    timeout_s: Duration = 5.0

    def open(self, door_name: str, between: tuple[str, str]) -> None:
        """Calls the address. Raises RuntimeError when nobody answers, or with another status."""
        request = Request(self.url, b"" if self.method != "GET" else None, method=self.method)
        try:
            with urlopen(request, timeout=self.timeout_s):
                pass
        except HTTPError as error:
            raise RuntimeError(f"{self.url} answered {error.code} {error.reason}") from error
        except TimeoutError as error:
            raise RuntimeError(f"{self.url} did not answer within {self.timeout_s:g} s") from error
        except (OSError, ValueError) as error:
            raise RuntimeError(f"{self.url} cannot be reached: {getattr(error, 'reason', error)}") from error
