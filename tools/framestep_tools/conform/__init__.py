"""A conformance kit: whether a device does what the DMC v2 specification says, judged from outside.

The checks are written from the specification's words, apart from the firmware and its constants.
docs/internals/conformance.md says how they judge.
"""
