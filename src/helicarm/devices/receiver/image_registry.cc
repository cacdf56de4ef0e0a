// SPDX-License-Identifier: Apache-2.0
#include "helicarm/devices/receiver/image_registry.h"

#include "helicarm/devices/receiver/listed_files.h"

namespace helicarm::receiver {
namespace {

using Opened = Expected<std::unique_ptr<ImageSource>>;

struct Open {
  Inbox& inbox;
  ReceiverHooks hooks;

  Opened operator()(const ReceiverOptions& options) const {
    return DicomReceiver::open(options, inbox, hooks);
  }
  Opened operator()(const FolderOptions& options) const {
    if (!std::filesystem::is_directory(options.folder))
      return fail(Reason::missing_file, options.folder.string() + ": no such folder");
    return std::make_unique<WatchedFolder>(options, inbox, hooks);
  }
  Opened operator()(const FileList& list) const {
    return std::make_unique<ListedFiles>(list.files, inbox, hooks);
  }
};

}  // namespace

Opened open_images(const ImageSourceOptions& options, Inbox& inbox, ReceiverHooks hooks) {
  return std::visit(Open{inbox, std::move(hooks)}, options);
}

}  // namespace helicarm::receiver
