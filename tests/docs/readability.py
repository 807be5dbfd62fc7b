"""How hard a Markdown text is to read: its prose, and Flesch's reading ease of it."""

import re

_BLOCKS = re.compile(r"^```.*?^```$|<!--.*?-->", re.MULTILINE | re.DOTALL)
_LINK = re.compile(r"!?\[([^\]]*)\]\([^)]*\)")
_ENDS = re.compile(r"[.!?](?=\s|$)|\n\s*\n|\n(?=\s*(?:[>-]|\d\.)\s)")
_WORD = re.compile(r"[a-z]+(?:'[a-z]+)?")
_SILENT = re.compile(r"(?<=[^aeiouy])e(?=$|s$|d$)")
_SOUNDED = re.compile(r"(?:[^aeiouyl]le[sd]?|(?:[sxz]|[cs]h|[cg])es|[td]ed)$")
_GROUP = re.compile(r"[aeiouy]+")
_HIATUS = re.compile(
    r"(?<![tscg])(?<!hav)i[ao]|eo(?!p)|uie|(?<!gu)[aeiouy]ing|(?<![qg])ua|[iu]um|\bcrea|\bide?a|\barea|\breal[il]"
)


def prose(markdown):
    """The text without headings, code blocks, tables and the targets of links; words in backticks stay."""
    lines = _BLOCKS.sub("", markdown).splitlines()
    kept = ["" if line.startswith(("#", "    ", "|")) else line for line in lines]
    return re.sub(r"[`*_]", "", _LINK.sub(r"\1", "\n".join(kept)))


def syllables(word):
    """The syllables of an English word: its groups of vowels without a silent e, and one more where two sound apart."""
    heard = word if _SOUNDED.search(word) else _SILENT.sub("", word)
    return max(1, len(_GROUP.findall(heard)) + len(_HIATUS.findall(word)))


def reading_ease(markdown):
    """Flesch's reading ease: 60 and more is plain English."""
    sentences = [words for part in _ENDS.split(prose(markdown)) if (words := _WORD.findall(part.lower()))]
    words = [word for sentence in sentences for word in sentence]
    per_sentence, per_word = len(words) / len(sentences), sum(map(syllables, words)) / len(words)
    return 206.835 - 1.015 * per_sentence - 84.6 * per_word
