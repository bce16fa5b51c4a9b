// SPDX-License-Identifier: Apache-2.0
// A training run in one file: its settings, its data set's identity and its whole state, each block with a checksum.
#pragma once
#include <cstdint>
#include <filesystem>
#include <span>
#include <string>
#include <utility>
#include <vector>

#include "training/data/dataset.h"
#include "training/settings/settings.h"
#include "training/step/run_state.h"

namespace tg {

// What a run was made of, as text: lines of a name, a space and a value.
struct RunIdentity {
  std::string settings;
  std::string data;  // sizes, background, fingerprint

  bool operator==(const RunIdentity&) const = default;
};
// Flags that are no settings, and their values.
using FlagTexts = std::vector<std::pair<std::string, std::string>>;
// `fingerprint`: datasetFingerprint(), which reads every pixel, as this does where the background is random. `start`:
// the model that stage 1 went on from, if any. `quantized_for`: what says how the file is written that stage quantized
// is for; it counts where there is that stage. `context`: what is drawn beside the model, if anything.
RunIdentity runIdentity(const Dataset& dataset, const TrainSettings& settings, const std::string& fingerprint,
                        const GaussianModel* start = nullptr, const FlagTexts& quantized_for = {},
                        const GaussianModel* context = nullptr);

struct CheckpointHeader {
  RunIdentity identity;
  double seconds = 0;               // wall time of the run until here, all its sessions together
  std::uint64_t metrics_bytes = 0;  // of metrics.jsonl
};

struct Checkpoint {
  CheckpointHeader header;
  RunState state;
};

// File: magic "TGCKPT\r\n", u32 version, then blocks in a fixed order, the last one called "end". Block: u16 length of
// the name, name, u64 length of the content, content, u32 CRC-32 of all that precedes it in the block. Numbers are
// little-endian. Content is written from where it lies, without a copy. Atomic. Throws Error(cannotWrite).
void writeCheckpoint(const std::filesystem::path& path, const CheckpointHeader& header, const RunState& state);

// Nothing is allocated that the file is too short to fill. The state keeps the promises of its types: sizes agree,
// models pass checkModel. Throws Error(cannotRead / badData) naming the block.
Checkpoint readCheckpoint(const std::filesystem::path& path);
Checkpoint parseCheckpoint(std::span<const std::uint8_t> bytes, const std::string& path);

// Throws Error(usage) naming the first setting or fact about the data that differs, Error(badData) for a state that no
// run with these settings and data can reach. A setting that the checkpoint does not name is one that came later: its
// default is what happened before. `path` starts the message.
void checkResumable(const Checkpoint& checkpoint, const RunIdentity& identity, const Dataset& dataset,
                    const TrainSettings& settings, const std::string& path);

}  // namespace tg
