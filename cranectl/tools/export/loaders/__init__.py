"""Load controllers from FMUs and from other processes; `cranectl.loaders.opening` finds these loaders."""
