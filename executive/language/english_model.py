"""Loads spaCy's English model without the parts that a command never uses, which is most of what loading it takes."""

from __future__ import annotations

import re
import sys
import warnings
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from functools import cached_property
from importlib.metadata import EntryPoints
from pathlib import Path
from types import ModuleType
from typing import TYPE_CHECKING, Any, Final

import numpy as np

from executive.language.word_rows import WordRows

if TYPE_CHECKING:
    from spacy.language import Language
    from spacy.tokens import Doc

__all__ = ["load_english"]

_UNUSED_PIPES: Final = ("senter", "ner")
_FRAMEWORKS: Final = ("torch", "cupy")  # spaCy imports them where they are installed; the model needs neither
_YAML_OF_SPACY: Final = ("read_yaml", "write_yaml", "yaml_dumps", "yaml_loads", "is_yaml_serializable")


def load_english(folder: Path) -> tuple[Language, WordRows]:
    """The pipeline in a folder, and the rows of its word vectors.

    The store of strings is left out: it holds every word of the vectors, and only the labels are ever looked up. The
    vectors stay in their file until they are used. The tokenizer's rules come from the folder alone.
    """
    with _small_spacy():
        from spacy.tokenizer import Tokenizer
        from spacy.util import get_model_meta, load_config, load_model_from_config, registry
        from spacy.vectors import Vectors
    registry.tokenizers("errand.empty", func=lambda: lambda pipeline: Tokenizer(pipeline.vocab))
    config = load_config(folder / "config.cfg")
    config["nlp"]["tokenizer"] = {"@tokenizers": "errand.empty"}
    with warnings.catch_warnings():
        warnings.filterwarnings("ignore", message=r"\[W095\]")  # trained with a release a little older
        meta = get_model_meta(folder)
        pipeline = load_model_from_config(config, vocab=True, exclude=_UNUSED_PIPES, meta=meta)
        pipeline.vocab.from_disk(folder / "vocab", exclude=("strings", "vectors"))
        pipeline.from_disk(folder, exclude=(*_UNUSED_PIPES, "vocab", "tokenizer"))
    rows = WordRows(folder / "vocab" / "key2row")
    data = np.load(folder / "vocab" / "vectors", mmap_mode="r")
    pipeline.vocab.vectors = Vectors(strings=pipeline.vocab.strings, data=data, name=meta["vectors"]["name"])
    pipeline.vocab.vectors.key2row = rows
    pipeline.tokenizer = RuleTokenizer.read(pipeline, folder / "tokenizer")
    for label in (label for _, pipe in pipeline.pipeline for label in getattr(pipe, "labels", ())):
        pipeline.vocab.strings.add(label)
    return pipeline, rows


class _Affix:
    """A regular expression that is compiled once a word needs it: in letters, or a blank, it finds nothing."""

    def __init__(self, pattern: str) -> None:
        self._pattern = pattern

    @cached_property
    def _compiled(self) -> re.Pattern[str]:
        return re.compile(self._pattern)

    def search(self, word: str) -> re.Match[str] | None:
        return None if _is_plain(word) else self._compiled.search(word)

    def finditer(self, word: str) -> Iterator[re.Match[str]]:
        return iter(()) if _is_plain(word) else self._compiled.finditer(word)

    def match(self, word: str) -> re.Match[str] | None:
        return None if _is_plain(word) else self._compiled.match(word)


def _is_plain(word: str) -> bool:
    return word.isascii() and (word.isalpha() or word == " ")


class RuleTokenizer:
    """spaCy's tokenizer; a rule for a word ("don't", "o'clock") is added once a text holds that word."""

    def __init__(self, tokenizer: Callable[[str], Doc], rules: Mapping[str, Sequence[Mapping[Any, str]]]) -> None:
        self._tokenizer: Any = tokenizer
        self._rules = dict(rules)

    @classmethod
    def read(cls, pipeline: Language, file: Path) -> RuleTokenizer:
        """The tokenizer that a file holds, for a pipeline."""
        import srsly
        from spacy.tokenizer import Tokenizer

        stored = srsly.read_msgpack(file)
        tokenizer = Tokenizer(
            pipeline.vocab,
            prefix_search=_Affix(stored["prefix_search"]).search,
            suffix_search=_Affix(stored["suffix_search"]).search,
            infix_finditer=_Affix(stored["infix_finditer"]).finditer,
            url_match=_Affix(stored["url_match"]).match,
            faster_heuristics=stored["faster_heuristics"],
        )
        return cls(tokenizer, stored["exceptions"])

    def __call__(self, text: str) -> Doc:
        for word in [word for word in self._rules if word in text]:
            self._tokenizer.add_special_case(word, self._rules.pop(word))
        doc: Doc = self._tokenizer(text)
        return doc


@contextmanager
def _small_spacy() -> Iterator[None]:
    """While spaCy is imported, stand-ins replace what its pipelines never use and what takes long to import.

    Those are its command line, its YAML, and bridges to other frameworks. Nor does it look for plug-ins of its own.
    """
    if "spacy" in sys.modules:
        yield
        return
    stand_ins: dict[str, Any] = {name: ModuleType(name) for name in ("spacy.cli", "spacy.cli.info", "srsly._yaml_api")}
    stand_ins["spacy.cli.info"].info = None
    stand_ins["srsly._yaml_api"].__dict__.update(dict.fromkeys(_YAML_OF_SPACY))
    missing = dict.fromkeys(("pydantic.v1", *_FRAMEWORKS))  # an import of these raises ImportError
    stand_ins = {name: module for name, module in {**stand_ins, **missing}.items() if name not in sys.modules}
    sys.modules.update(stand_ins)
    try:
        import catalogue

        catalogue.AVAILABLE_ENTRY_POINTS = EntryPoints(())
        yield
    finally:
        for name in stand_ins:
            sys.modules.pop(name, None)
