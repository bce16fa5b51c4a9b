// SPDX-License-Identifier: Apache-2.0
// What tgview does without a window.
#pragma once
#include "viewer/view/options.h"

namespace tg {

// render.cpp: --render: one image to a file, without a display and without touching the window system.
// Writes the image and prints one line about it to stdout, warnings to stderr. Throws Error of every kind; a failed
// run leaves no file.
void renderToFile(const ViewOptions& options);

// record.cpp: --output: a path or a turntable to pictures or a video, without a window.
// Says how far it is on stderr and prints one line about the result to stdout. Throws Error of every kind; a run that
// fails leaves no video.
void recordToFile(const ViewOptions& options);

// compare.cpp: --render with --compare or --photos: two pictures of one view to one file, and how far they are apart.
// Writes what the window's comparison shows of the same view and prints one line with the metrics. Throws Error of
// every kind; a failed run leaves no file.
void compareToFile(const ViewOptions& options);

// benchmark.cpp: --benchmark without a window.
// Renders options.path without a window and prints the JSON. On a device a frame is what the window would draw: nothing
// is read back. Throws Error of every kind.
void benchmarkHeadless(const ViewOptions& options);

// inspect.cpp: --inspect: a model's splats under a pixel, as JSON.
// Prints to stdout. Throws Error of every kind.
void inspectHeadless(const ViewOptions& options);

// serve.cpp: --serve: a model, or with --follow a run, as a page for browsers, until a signal ends it.
// Throws Error of every kind.
void serveModel(const ViewOptions& options);

}  // namespace tg
