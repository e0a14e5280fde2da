"""A process that does nothing but wait; for the test of what ends it."""

import time

if __name__ == "__main__":
    time.sleep(600)
