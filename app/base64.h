// Bytes as text that stands in a URL or a page (RFC 4648, with padding). A plain function, safe from any thread.
#pragma once

#include <string>
#include <vector>

namespace parallax {

std::string to_base64(const std::vector<unsigned char>& bytes);

}  // namespace parallax
