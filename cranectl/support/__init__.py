"""Provide general tools that know nothing of cranes: errors, files, text, compiled code, interrupts."""
