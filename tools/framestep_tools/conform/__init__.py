"""A conformance kit: checks from outside whether a device follows the DMC v2 specification.

The checks are written from the specification's text, independently of the firmware and its
constants. docs/internals/conformance.md says how they judge.
"""
