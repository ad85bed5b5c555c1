"""What any program needs and no crane: errors, files, text, compiled code, interrupts."""
