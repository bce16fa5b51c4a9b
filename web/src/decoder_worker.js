// SPDX-License-Identifier: Apache-2.0
// The decoder's worker (decoder_home.js).
import {decodeFor} from './decoder.js';

decodeFor(self);
