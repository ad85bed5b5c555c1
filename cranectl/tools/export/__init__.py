"""Export controllers as C99 and FMUs, and plants as FMUs; load controllers from FMUs and other processes."""
