# SPDX-License-Identifier: Apache-2.0
"""Experiment: a bad pour gets better by practice."""
