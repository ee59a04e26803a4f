"""The controller on this computer, and what stands beside it: boards, driver chips, chains."""
