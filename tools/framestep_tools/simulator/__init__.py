"""The controller on this computer, with simulated boards, driver chips and shift registers."""
