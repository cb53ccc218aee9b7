# SPDX-License-Identifier: Apache-2.0
"""The pole: a person points at spots behind it, the arm reaches them on one side or the other."""
