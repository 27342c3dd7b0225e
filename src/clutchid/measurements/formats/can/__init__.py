"""CAN logs (BLF, ASC, MF4) and the DBC files that decode them."""
