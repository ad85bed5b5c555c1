"""The rig in Drake."""
