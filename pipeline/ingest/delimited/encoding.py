"""Which characters the bytes of a text file stand for.

Judged from the first bytes: a byte-order mark, the zeros of UTF-16, valid UTF-8, and else by which legacy encoding
yields the words that headers are made of, or at least characters that people write. Only what labs meet is thought of.
"""

from __future__ import annotations

import codecs
import re
import unicodedata
from dataclasses import dataclass

from pipeline.recording.unit_words import symbol_of

_MARKS = (
    (codecs.BOM_UTF8, "utf-8"),
    (codecs.BOM_UTF32_LE, "utf-32-le"),  # before UTF-16, whose mark begins it
    (codecs.BOM_UTF32_BE, "utf-32-be"),
    (codecs.BOM_UTF16_LE, "utf-16-le"),
    (codecs.BOM_UTF16_BE, "utf-16-be"),
)
# In the order in which they are met; those of the second line are believed only where they yield words of headers.
_JUDGED = ("cp1252", "gb18030", "shift_jis", "cp850", "cp1251")
_BY_WORDS_ONLY = ("cp949", "koi8_r", "cp866", "big5", "euc_jp")
# What headers call channels, beside the units that are written out; in lower case.
_HEADINGS = frozenset(
    word
    for words in (
        "время перемещение ход усилие сила нагрузка ток деформация частота напряжение давление температура момент",
        "时间 位移 力 载荷 电流 频率 压力 温度 時間 應力 荷重 変位 電流 周波数 時刻 荷載 溫度",
        "시간 변위 하중 힘 전류 주파수 압력 온도 변형률 토크",
    )
    for word in words.split()
)
_SIGNS = set("°µ²³±×·Ω§–—’“”€½Øøπ")
_WORD = re.compile(r"[^\W\d_]+")
_CONTROLS = bytes(set(range(32)) - set(b"\t\n\r\f\v\x1a\x1b"))


@dataclass(frozen=True)
class Encoding:
    """A Python codec and the length of the byte-order mark before the text."""

    codec: str
    mark: int = 0

    @property
    def is_wide(self) -> bool:
        """Tell whether a line end is more than one byte (UTF-16, UTF-32)."""
        return self.codec.startswith(("utf-16", "utf-32"))


def detect(head: bytes) -> Encoding | None:
    """Return the encoding of a text that begins with `head`, None where it is no text.

    Examples
    --------
    >>> detect("Prüfkraft [N]".encode("cp1252")).codec
    'cp1252'
    >>> detect("时间,位移,力".encode("gb18030")).codec
    'gb18030'
    >>> detect("Время;Ход\\nс;мм".encode("cp1251")).codec
    'cp1251'
    """
    for mark, codec in _MARKS:
        if head.startswith(mark):
            return Encoding(codec, len(mark))
    if wide := _wide_without_mark(head):
        return wide
    if b"\0" in head or len(head.translate(None, _CONTROLS)) < 0.98 * len(head):
        return None
    if _decodes(head, "utf-8"):
        return Encoding("utf-8")
    words = _foreign_words(head)
    known = {codec: _known_words(words, codec) for codec in (*_JUDGED, *_BY_WORDS_ONLY)}
    if max(known.values(), default=0):
        return Encoding(max(known, key=lambda codec: (known[codec], _plausibility(words, codec))))
    scores = {codec: _plausibility(words, codec) for codec in _JUDGED}
    best = max(scores, key=lambda codec: scores[codec])  # the first of equals
    if scores[best] > 0:
        return Encoding(best)
    return Encoding("latin-1")


def is_text_with_zeros(head: bytes) -> bool:
    """Tell whether bytes are text but for some zero bytes: damage, where binary data would have other controls too.

    Examples
    --------
    >>> is_text_with_zeros(b"time,force\\n0,1\\n0.1,\\x00\\n"), is_text_with_zeros(bytes(range(256)))
    (True, False)
    """
    rest = head.replace(b"\0", b"")
    return b"\0" in head and (not rest or (len(rest) > 0.5 * len(head) and detect(rest) is not None))


def _wide_without_mark(head: bytes) -> Encoding | None:
    """UTF-16 of mostly Latin text has a zero in every other byte."""
    sample = head[: len(head) // 2 * 2][:4096]
    if len(sample) < 8:
        return None
    even, odd = sample[::2].count(0), sample[1::2].count(0)
    if odd > 0.6 * len(sample) / 2 and even == 0:
        return Encoding("utf-16-le")
    if even > 0.6 * len(sample) / 2 and odd == 0:
        return Encoding("utf-16-be")
    return None


def _decodes(head: bytes, codec: str) -> bool:
    """Tell whether `head`, which may end in the middle of a character, is valid."""
    try:
        codecs.getincrementaldecoder(codec)().decode(head)
    except UnicodeDecodeError:
        return False
    return True


def _foreign_words(head: bytes) -> list[bytes]:
    """Return the cells that hold bytes beyond ASCII, whole, so that no character is cut."""
    for separator in b'\n\r\t;," ':
        head = head.replace(bytes([separator]), b"\n")
    return [word for word in head.split(b"\n")[:20000] if not word.isascii()][:500]


def _known_words(words: list[bytes], codec: str) -> int:
    """Return how many different words are names of units or channels; 0 where a word does not decode."""
    found = set()
    for word in words:
        try:
            text = word.decode(codec)
        except UnicodeDecodeError:
            return 0
        for part in _WORD.findall(text):
            is_word = not part.isascii() and (len(part) > 1 or part.lower() == part.upper())  # letters alone say little
            if is_word and (part.lower() in _HEADINGS or symbol_of(part) is not None):
                found.add(part)
    return len(found)


def _plausibility(words: list[bytes], codec: str) -> float:
    """Return the mean likeliness, 0 to 1, of the characters beyond ASCII; 0 where a word does not decode."""
    total, count = 0.0, 0
    for word in words:
        try:
            text = word.decode(codec)
        except UnicodeDecodeError:
            return 0.0
        if codec == "cp1251":
            likely = [value for part in _WORD.findall(text) for value in _cyrillic(part)]
            likely += [1.0 for sign in text if sign in _SIGNS]
            total, count = total + sum(likely), count + len(likely)
            continue
        for before, character in zip(" " + text, text, strict=False):
            if not character.isascii():
                total += _likeliness(before, character, codec)
                count += 1
    return total / count if count else 0.0


def _likeliness(before: str, character: str, codec: str) -> float:
    if codec == "gb18030":
        return _chinese(character)
    if codec == "shift_jis":
        return _japanese(character)
    if character in _SIGNS:
        return 1.0
    kind = unicodedata.category(character)
    if kind == "Ll":
        # Accented letters stand alone among plain ones: runs of them are another alphabet misread.
        return 1.0 if before.isascii() else 0.6
    return 0.8 if kind == "Lu" and not before.islower() and before.isascii() else 0.2


def _chinese(character: str) -> float:
    """GB 2312 orders its characters: first signs, then the 3755 common ones, then the rare ones."""
    try:
        lead = character.encode("gb2312")[0]
    except UnicodeEncodeError:
        return 0.1 if "\u4e00" <= character <= "\u9fff" else 0.0
    if lead >= 0xD8:
        return 0.4
    return 1.0 if lead >= 0xB0 or lead <= 0xA3 else 0.5


def _japanese(character: str) -> float:
    if "\u3040" <= character <= "\u30ff":
        return 1.0
    if "\uff61" <= character <= "\uff9f":  # half-width kana: any single high byte reads as one
        return 0.25
    lead = character.encode("shift_jis")[0]
    return 0.95 if 0x88 <= lead <= 0x97 else 0.3


def _cyrillic(word: str) -> list[float]:
    """Return how likely each letter beyond ASCII is: capitals begin words or fill them, and no word mixes alphabets."""
    foreign = [letter for letter in word if not letter.isascii()]
    is_mixed = len(foreign) < len(word)
    capitals_fit = word.isupper() or word[1:].islower() or len(word) == 1
    likely = 1.0 if capitals_fit and not is_mixed else 0.1
    return [likely if "\u0410" <= letter <= "\u0451" else 0.1 for letter in foreign]
