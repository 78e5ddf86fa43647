"""Units as people write them out in German, French, Russian, Chinese, Japanese and Korean, by the symbol that pint knows.

Words are looked up in lower case, symbols of other scripts as they are; nothing here is ambiguous with an SI symbol.
"""

from __future__ import annotations

# fmt: off
_BY_SYMBOL = {
    "s": "second seconds secs sekunde sekunden seconde secondes сек секунда секунды секунд 秒钟 秒鐘 초",
    "ms": "millisekunde millisekunden milliseconde millisecondes мсек миллисекунды ミリ秒 毫秒",
    "us": "mikrosekunden microsecondes мкс мксек 微秒 マイクロ秒",
    "min": "minute minuten minutes мин минуты 分钟 分鐘",
    "h": "stunde stunden heure heures час часы 小时 小時 時間",
    "m": "meter metre metres mètre mètres метр метры 米 公尺 メートル",
    "mm": "millimeter millimetre millimetres millimètre millimètres мм миллиметр миллиметры 毫米 公厘 ミリ ミリメートル 밀리미터",
    "cm": "zentimeter centimetre centimètre centimètres см 厘米 公分 センチ センチメートル",
    "um": "mikrometer micromètre micromètres мкм 微米 マイクロメートル ミクロン",
    "N": "newton newtons ньютон ньютоны 牛 牛顿 牛頓 ニュートン 뉴턴",
    "kN": "kilonewton kilonewtons кн килоньютон килоньютоны 千牛 千牛顿 キロニュートン",
    "kgf": "кгс 公斤力 千克力",
    "A": "ampere amperes ampère ampères amp amps ампер амперы 安 安培 アンペア",
    "mA": "milliampere milliampère мА 毫安 ミリアンペア",
    "V": "volt volts вольт вольты 伏 伏特 ボルト",
    "mV": "millivolt millivolts мВ 毫伏 ミリボルト",
    "Hz": "hertz герц гц 赫 赫兹 赫茲 ヘルツ",
    "kHz": "kilohertz кгц 千赫 千赫兹 キロヘルツ",
    "degC": "celsius °с 摄氏度 攝氏度 摂氏 摂氏度 度c",
    "deg": "degrees degré degrés градус градусы град",
    "rad": "radiant radian radians рад 弧度 ラジアン",
    "Pa": "pascal pascals па паскаль 帕 帕斯卡 パスカル",
    "kPa": "kilopascal кпа 千帕 キロパスカル",
    "MPa": "megapascal мпа 兆帕 メガパスカル",
    "bar": "бар 巴 バール",
    "T": "tesla тесла 特斯拉 テスラ",
    "mT": "millitesla мтл 毫特 毫特斯拉 ミリテスラ",
    "kg": "kilogramm kilogramme kilogrammes кг килограмм 千克 公斤 キログラム",
    "g": "gramm gramme grammes грамм 克 グラム",
    "W": "watt watts ватт вт 瓦 瓦特 ワット",
    "N*m": "newtonmeter н·м нм 牛米 牛·米 牛顿米 ニュートンメートル",
    "rpm": "об/мин 转/分 轉/分 转每分 回転/分",
    "%": "prozent pourcent процент 百分比 パーセント",
    "1": "einheitslos dimensionslos 无 無 无量纲 無次元",
}
# Single letters of other scripts, whose case counts: seconds and newton, not coulomb.
_LETTERS = {"с": "s", "м": "m", "Н": "N", "А": "A", "В": "V", "К": "K", "т": "t", "ч": "h", "г": "g", "分": "min",
            "时": "h", "時": "h", "度": "deg", "Вт": "W", "Тл": "T", "мс": "ms"}
# fmt: on
_WORDS = {word.casefold(): symbol for symbol, words in _BY_SYMBOL.items() for word in words.split()}


def symbol_of(word: str) -> str | None:
    """Return the symbol of a unit that is written out or in another script, None for any other word.

    Examples
    --------
    >>> symbol_of("毫米"), symbol_of("Sekunden"), symbol_of("кН"), symbol_of("kN")
    ('mm', 's', 'kN', None)
    """
    return _LETTERS.get(word) or _WORDS.get(word.casefold())
