"""From residuals to numbers with honest errors. Import from the modules; nothing is loaded here.

======================================  ===========================================================
question                                module
======================================  ===========================================================
which frequency, which harmonics        `harmonic`
which parameters fit best               `least_squares`; `separable` where most of them are linear
how certain are they                    `uncertainty`, `bootstrap`, `scatter`, `profile`
which of them can be told at all        `identifiability`
which model                             `selection`
is only noise left                      `residuals`
how is one result handed on             `estimate`
======================================  ===========================================================
"""
