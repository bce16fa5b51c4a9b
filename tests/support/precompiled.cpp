// SPDX-License-Identifier: Apache-2.0
// Nothing: the target of the precompiled header has a source.
