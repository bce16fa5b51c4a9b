// SPDX-License-Identifier: Apache-2.0
// A loop over all cores. Workers sleep between loops (they do not spin: a spinning pool starves on a shared machine).
#pragma once
#include <cstdint>
#include <functional>

namespace tg {

// 0 = as many as the machine has (the default). Affects loops that begin later, on any thread, and may be called while
// others run, but not inside one.
void setThreadCount(int count);
// Inside a loop: that one's.
int threadCount();

// Calls body(i) for i in [0, count) on all threads, in any order, `grain` consecutive items per grab; returns when all
// are done. The result must not depend on the order. An exception in body is rethrown here (the first one caught).
// Nested calls run serially on the calling thread.
void parallelFor(std::int64_t count, std::int64_t grain, const std::function<void(std::int64_t)>& body);

// The same on `workers` threads at most, for per-thread scratch space: made for threadCount() of them, which may be
// another one by the time the loop begins. The worker's number is in [0, workers).
void parallelForWorkers(std::int64_t count, std::int64_t grain, std::int64_t workers,
                        const std::function<void(std::int64_t item, int worker)>& body);
// Whether this thread is inside such a loop.
bool insideParallelFor();

}  // namespace tg
