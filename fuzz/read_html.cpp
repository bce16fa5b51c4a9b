// SPDX-License-Identifier: Apache-2.0
// Any bytes are a page with a model or an Error. A fuzzer cannot guess gzip's checksum: inputs that start with 'G' are
// packed into a page as they are, so that what lies behind is reached.
#include <openssl/evp.h>
#include <zlib.h>

#include <cstdlib>
#include <string>
#include <vector>

#include "converter/gltf/read_gltf.h"
#include "converter/html/html.h"
#include "core/system/error.h"

namespace {

std::string pageOf(const std::uint8_t* data, std::size_t size) {
  z_stream stream{};
  if (deflateInit2(&stream, Z_NO_COMPRESSION, Z_DEFLATED, 31, 8, Z_DEFAULT_STRATEGY) != Z_OK) std::abort();
  std::vector<std::uint8_t> packed(deflateBound(&stream, size) + 64);
  stream.next_in = const_cast<std::uint8_t*>(data);
  stream.avail_in = static_cast<uInt>(size);
  stream.next_out = packed.data();
  stream.avail_out = static_cast<uInt>(packed.size());
  if (deflate(&stream, Z_FINISH) != Z_STREAM_END) std::abort();
  const std::size_t length = stream.total_out;
  deflateEnd(&stream);
  std::vector<unsigned char> text(length / 3 * 4 + 8);
  const int written = EVP_EncodeBlock(text.data(), packed.data(), static_cast<int>(length));
  return std::string(tg::kHtmlStart) + std::string(tg::kHtmlModelTag) +
         std::string(text.begin(), text.begin() + written) + std::string(tg::kHtmlModelEnd);
}

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  std::string page(reinterpret_cast<const char*>(data), size);
  if (size > 0 && data[0] == 'G') page = pageOf(data + 1, size - 1);
  try {
    const std::vector<std::uint8_t> glb =
        tg::parseHtmlGlb({reinterpret_cast<const std::uint8_t*>(page.data()), page.size()}, "fuzz.html");
    tg::checkModel(tg::parseGltf(glb, "fuzz.html", {}).model, "fuzz.html");
  } catch (const tg::Error&) {
  }
  return 0;
}
