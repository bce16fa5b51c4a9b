// SPDX-License-Identifier: Apache-2.0
// SHA-256 of a block of memory. Private to core.
#pragma once
#include <openssl/evp.h>

#include <cstdint>
#include <span>
#include <stdexcept>
#include <string>

namespace tg {

// 64 lower-case hexadecimal digits.
inline std::string sha256Hex(std::span<const std::uint8_t> bytes) {
  unsigned char digest[EVP_MAX_MD_SIZE];
  unsigned int length = 0;
  if (EVP_Digest(bytes.data(), bytes.size(), digest, &length, EVP_sha256(), nullptr) != 1 || length != 32)
    throw std::runtime_error("libcrypto cannot compute SHA-256");
  constexpr char digits[] = "0123456789abcdef";
  std::string hex;
  for (unsigned int i = 0; i < length; ++i) {
    hex += digits[digest[i] >> 4];
    hex += digits[digest[i] & 15];
  }
  return hex;
}

}  // namespace tg
