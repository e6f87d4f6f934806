#include "runtime/record/mcap_writer.h"

#include <algorithm>
#include <span>

#include "runtime/record/record_blocks.h"

namespace tumbler {
namespace {

constexpr std::string_view kMagic{"\x89MCAP0\r\n", 8};
/// A chunk ends with the message that makes it this long [bytes].
constexpr std::size_t kChunkBytes = 1U << 20U;

enum class Opcode : std::uint8_t {
  kHeader = 0x01,
  kFooter = 0x02,
  kSchema = 0x03,
  kChannel = 0x04,
  kMessage = 0x05,
  kChunk = 0x06,
  kMessageIndex = 0x07,
  kChunkIndex = 0x08,
  kStatistics = 0x0B,
  kMetadata = 0x0C,
  kMetadataIndex = 0x0D,
  kSummaryOffset = 0x0E,
  kDataEnd = 0x0F,
};

template <typename Number>
void Put(std::string& out, Number number) {
  auto rest = static_cast<std::uint64_t>(number);
  for (std::size_t i = 0; i < sizeof(Number); ++i) {
    out.push_back(static_cast<char>(rest & 0xffU));
    rest >>= 8U;
  }
}

/// A text or bytes, after their length.
void PutText(std::string& out, std::string_view text) {
  Put(out, static_cast<std::uint32_t>(text.size()));
  out.append(text);
}

void PutTexts(std::string& out, const McapWriter::Texts& texts) {
  std::string pairs;
  for (const auto& [key, value] : texts) {
    PutText(pairs, key);
    PutText(pairs, value);
  }
  PutText(out, pairs);
}

std::string Record(Opcode opcode, std::string_view content) {
  std::string record;
  record.reserve(content.size() + 9);
  record.push_back(static_cast<char>(opcode));
  Put(record, static_cast<std::uint64_t>(content.size()));
  record.append(content);
  return record;
}

std::uint32_t CrcOf(std::string_view text, std::uint32_t before = 0) {
  return Crc32({reinterpret_cast<const std::uint8_t*>(text.data()), text.size()}, before);
}

}  // namespace

McapWriter::McapWriter(OutputFile& file, std::string_view library) : file_(file) {
  std::string header;
  PutText(header, "");  // No profile: names and types of topics are our own choice.
  PutText(header, library);
  Append(kMagic);
  Append(Record(Opcode::kHeader, header));
}

void McapWriter::Append(std::string_view bytes) {
  file_.Append(bytes);
  crc_ = CrcOf(bytes, crc_);
  offset_ += bytes.size();
}

McapWriter::Schema McapWriter::AddSchema(std::string_view name, std::string_view descriptors) {
  std::string content;
  Put(content, ++schema_count_);
  PutText(content, name);
  PutText(content, "protobuf");
  PutText(content, descriptors);
  const std::string record = Record(Opcode::kSchema, content);
  schemas_ += record;
  chunk_ += record;
  return schema_count_;
}

McapWriter::Channel McapWriter::AddChannel(Schema schema, std::string_view topic,
                                           const Texts& metadata) {
  const auto id = static_cast<Channel>(states_.size());
  states_.emplace_back();
  std::string content;
  Put(content, id);
  Put(content, schema);
  PutText(content, topic);
  PutText(content, "protobuf");
  PutTexts(content, metadata);
  const std::string record = Record(Opcode::kChannel, content);
  channels_ += record;
  chunk_ += record;
  return id;
}

void McapWriter::AddMetadata(std::string_view name, const Texts& texts) {
  std::string content;
  PutText(content, name);
  PutTexts(content, texts);
  const std::string record = Record(Opcode::kMetadata, content);
  std::string index;
  Put(index, offset_);
  Put(index, static_cast<std::uint64_t>(record.size()));
  PutText(index, name);
  metadata_indexes_ += Record(Opcode::kMetadataIndex, index);
  ++metadata_count_;
  Append(record);
}

void McapWriter::Write(Channel channel, std::uint64_t time_ns, std::string_view message) {
  ChannelState& state = states_[channel];
  const bool first_of_chunk = std::all_of(states_.begin(), states_.end(),
                                          [](const ChannelState& s) { return s.index.empty(); });
  chunk_first_ns_ = first_of_chunk ? time_ns : std::min(chunk_first_ns_, time_ns);
  chunk_last_ns_ = first_of_chunk ? time_ns : std::max(chunk_last_ns_, time_ns);
  first_ns_ = messages_ == 0 ? time_ns : std::min(first_ns_, time_ns);
  last_ns_ = messages_ == 0 ? time_ns : std::max(last_ns_, time_ns);
  ++messages_;
  state.index.emplace_back(time_ns, chunk_.size());
  std::string content;
  content.reserve(message.size() + 22);
  Put(content, channel);
  Put(content, state.sequence++);
  Put(content, time_ns);  // when it was logged
  Put(content, time_ns);  // when it was published
  content.append(message);
  chunk_ += Record(Opcode::kMessage, content);
  if (chunk_.size() >= kChunkBytes) CloseChunk();
}

void McapWriter::CloseChunk() {
  if (chunk_.empty()) return;
  std::string content;
  Put(content, chunk_first_ns_);
  Put(content, chunk_last_ns_);
  Put(content, static_cast<std::uint64_t>(chunk_.size()));
  Put(content, CrcOf(chunk_));
  PutText(content, "");  // not compressed
  Put(content, static_cast<std::uint64_t>(chunk_.size()));
  content += chunk_;
  const std::string chunk = Record(Opcode::kChunk, content);
  const std::uint64_t chunk_offset = offset_;
  Append(chunk);
  const std::uint64_t indexes_offset = offset_;
  std::string offsets;
  for (std::size_t i = 0; i < states_.size(); ++i) {
    auto& index = states_[i].index;
    if (index.empty()) continue;
    std::stable_sort(index.begin(), index.end(),
                     [](const auto& a, const auto& b) { return a.first < b.first; });
    const auto channel = static_cast<Channel>(i);
    Put(offsets, channel);
    Put(offsets, offset_);
    std::string entries;
    for (const auto& [time_ns, offset] : index) {
      Put(entries, time_ns);
      Put(entries, offset);
    }
    std::string message_index;
    Put(message_index, channel);
    PutText(message_index, entries);
    Append(Record(Opcode::kMessageIndex, message_index));
    index.clear();
  }
  std::string index;
  Put(index, chunk_first_ns_);
  Put(index, chunk_last_ns_);
  Put(index, chunk_offset);
  Put(index, static_cast<std::uint64_t>(chunk.size()));
  PutText(index, offsets);
  Put(index, offset_ - indexes_offset);
  PutText(index, "");
  Put(index, static_cast<std::uint64_t>(chunk_.size()));
  Put(index, static_cast<std::uint64_t>(chunk_.size()));
  chunk_indexes_ += Record(Opcode::kChunkIndex, index);
  ++chunk_count_;
  chunk_.clear();
  chunk_first_ns_ = chunk_last_ns_ = 0;
}

/// Everything from the end of the data on but the footer: groups of records, and where they begin.
std::string McapWriter::Summary() {
  std::string statistics;
  Put(statistics, messages_);
  Put(statistics, schema_count_);
  Put(statistics, static_cast<std::uint32_t>(states_.size()));
  Put(statistics, std::uint32_t{0});  // attachments
  Put(statistics, metadata_count_);
  Put(statistics, chunk_count_);
  Put(statistics, first_ns_);
  Put(statistics, last_ns_);
  std::string counts;
  for (std::size_t i = 0; i < states_.size(); ++i) {
    Put(counts, static_cast<Channel>(i));
    Put(counts, std::uint64_t{states_[i].sequence});
  }
  PutText(statistics, counts);
  const std::array<std::pair<Opcode, std::string>, 5> groups{
      {{Opcode::kSchema, schemas_},
       {Opcode::kChannel, channels_},
       {Opcode::kStatistics, Record(Opcode::kStatistics, statistics)},
       {Opcode::kChunkIndex, chunk_indexes_},
       {Opcode::kMetadataIndex, metadata_indexes_}}};
  std::string summary, offsets;
  for (const auto& [opcode, records] : groups) {
    if (records.empty()) continue;
    std::string content;
    Put(content, static_cast<std::uint8_t>(opcode));
    Put(content, offset_ + summary.size());
    Put(content, static_cast<std::uint64_t>(records.size()));
    offsets += Record(Opcode::kSummaryOffset, content);
    summary += records;
  }
  const std::uint64_t start = offset_, offsets_start = offset_ + summary.size();
  summary += offsets;
  // The footer's checksum is of the summary and of the footer up to itself.
  std::string footer;
  Put(footer, start);
  Put(footer, offsets_start);
  std::string head(1, static_cast<char>(Opcode::kFooter));
  Put(head, static_cast<std::uint64_t>(footer.size() + sizeof(std::uint32_t)));
  summary += head + footer;
  Put(summary, CrcOf(summary));
  return summary;
}

void McapWriter::Finish() {
  CloseChunk();
  std::string data_end;
  Put(data_end, crc_);
  Append(Record(Opcode::kDataEnd, data_end));
  Append(Summary());
  Append(kMagic);
  file_.Flush();
}

}  // namespace tumbler
