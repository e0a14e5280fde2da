"""Keeps what is finished: one JSON file a result, found again by everything that the result depends on."""

import hashlib
import json
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from records.figures_file import plain, write_text


@dataclass(frozen=True)
class Store:
    """Results in a folder."""

    folder: Path

    def find(self, name: str, key: Mapping[str, Any]) -> Any:
        """The result of that name and key, None if it is not there or damaged."""
        try:
            found = json.loads(self._path(name, key).read_text(encoding="utf-8"))
            return found["result"] if found["key"] == plain(key) else None
        except (OSError, ValueError, KeyError, TypeError):
            return None

    def keep(self, name: str, key: Mapping[str, Any], result: Any) -> Any:
        """Write a result; returns it as it will be read again."""
        self.folder.mkdir(parents=True, exist_ok=True)
        content = plain({"key": key, "result": result})
        write_text(self._path(name, key), json.dumps(content, indent=1, allow_nan=False) + "\n")
        return content["result"]

    def get(self, name: str, key: Mapping[str, Any], make: Callable[[], Any]) -> Any:
        """The result, made if it is not there."""
        found = self.find(name, key)
        return self.keep(name, key, make()) if found is None else found

    def _path(self, name: str, key: Mapping[str, Any]) -> Path:
        told = json.dumps(plain(key), sort_keys=True)
        return self.folder / f"{name}-{hashlib.sha256(told.encode()).hexdigest()[:12]}.json"
