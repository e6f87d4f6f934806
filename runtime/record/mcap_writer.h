#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <map>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "runtime/record/output_file.h"

namespace tumbler {

/// Writes a file in the container format MCAP: messages in chunks that have checksums and indexes,
/// and a summary at the end, so that readers find a time without reading the whole. Nothing is
/// compressed. The same calls give the same bytes. The file knows of failures.
class McapWriter {
 public:
  using Schema = std::uint16_t;
  using Channel = std::uint16_t;
  using Texts = std::map<std::string, std::string>;

  /// @param file     has to outlive the writer.
  /// @param library  the program that writes, for people.
  McapWriter(OutputFile& file, std::string_view library);

  /// Adds a type of messages in Protocol Buffers.
  /// @param name         its full name, e.g. `foxglove.Log`.
  /// @param descriptors  of its file and those that it imports (EncodeDescriptors).
  Schema AddSchema(std::string_view name, std::string_view descriptors);
  Channel AddChannel(Schema schema, std::string_view topic, const Texts& metadata = {});
  /// Adds texts about the file as a whole.
  void AddMetadata(std::string_view name, const Texts& texts);

  /// Appends a message. Times of one channel should not decrease.
  void Write(Channel channel, std::uint64_t time_ns, std::string_view message);

  /// Writes the rest. Nothing may be called afterwards.
  void Finish();

  /// How many messages were written.
  [[nodiscard]] std::uint64_t messages() const { return messages_; }

 private:
  struct ChannelState {
    std::uint32_t sequence = 0;
    std::vector<std::pair<std::uint64_t, std::uint64_t>>
        index;  ///< Times and offsets in the chunk.
  };

  void Append(std::string_view bytes);
  void CloseChunk();
  std::string Summary();

  OutputFile& file_;
  std::uint64_t offset_ = 0;                                           ///< Bytes written.
  std::uint32_t crc_ = 0;                                              ///< Of them.
  std::string schemas_, channels_, chunk_indexes_, metadata_indexes_;  ///< For the summary.
  std::vector<ChannelState> states_;
  std::uint16_t schema_count_ = 0;
  std::uint32_t metadata_count_ = 0, chunk_count_ = 0;
  std::uint64_t messages_ = 0, first_ns_ = 0, last_ns_ = 0;
  std::string chunk_;
  std::uint64_t chunk_first_ns_ = 0, chunk_last_ns_ = 0;
};

}  // namespace tumbler
