"""What is in a signal before any model is fitted. Import from the modules; nothing is loaded here.

`periodicity` tells the kind of excitation and what of it to use (`cycles`, `periodogram` below it);
`filtering` smooths and differentiates without phase shift; `resampling` brings onto a grid and keeps
gaps; `spectra` averages power and finds hum from the mains.
"""
