#include "runtime/record/recorded_assembly.h"

#include <fmt/format.h>

#include <exception>
#include <string>

namespace tumbler {
namespace {

RunParts LoadParts(const RecordConfiguration& configuration) {
  const FileReader read = RecordedFiles(configuration);
  RunParts parts = LoadRunMotion(configuration.motion_file, read);
  parts.drives =
      LoadDrivesOf(configuration.joints, configuration.drives_file, read, GainsOf(parts.file));
  return parts;
}

}  // namespace

FileReader RecordedFiles(const RecordConfiguration& configuration) {
  return [&configuration](const std::string& path) {
    for (const LoadedFile& file : configuration.files) {
      if (file.path == path) return file.text;
    }
    throw RecordError(fmt::format("configuration: '{}' is not among the recorded files", path));
  };
}

Assembly Assemble(const RecordConfiguration& configuration) {
  try {
    Assembly assembly(LoadParts(configuration));
    if (assembly.Configure(configuration.executor) != Status::kOk) {
      throw RecordError("the executor does not take the recorded configuration");
    }
    return assembly;
  } catch (const FileError&) {
    throw;
  } catch (const RecordError&) {
    throw;
  } catch (const std::exception& error) {
    throw RecordError(error.what());
  }
}

}  // namespace tumbler
