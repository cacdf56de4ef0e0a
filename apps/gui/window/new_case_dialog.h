// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <QComboBox>
#include <QDialog>
#include <QLabel>
#include <QLineEdit>
#include <QPushButton>
#include <QTableWidget>
#include <memory>
#include <set>

#include "gui/window/case_draft.h"

class QFormLayout;

namespace helicarm::gui {

/// A case of image files: images with frame and view, calibrator, plate, and where the case is written. Says
/// what is found and what is missing beside each; the work is done in the background.
class NewCaseDialog : public QDialog {
  Q_OBJECT

 public:
  explicit NewCaseDialog(QWidget* parent = nullptr);

  /// Of files that it does not have yet.
  void add_images(const std::vector<pipeline::NewImage>& images);
  /// Of the image of this file, if there is exactly one.
  void choose_frame(const std::filesystem::path& file, int frame);
  const CheckedDraft& checked() const { return checked_; }
  bool is_checking() const { return checking_; }

 signals:
  /// The case is written.
  void created(const std::filesystem::path& folder);

 protected:
  /// As high as its texts need at its width, as wide as larger text needs.
  bool event(QEvent* event) override;

 private:
  QWidget* build_preset_row();
  QWidget* build_images();
  QWidget* build_choices();
  QWidget* build_end();
  QComboBox* add_choice(QFormLayout* form, const QString& title, const char* name, QLabel*& lack);

  void ask_images();
  void remove_chosen();
  void ask_folder();
  void take_preset(const QString& name);
  void save_preset();
  void delete_preset();
  void list_presets(const QString& chosen);
  void give_preset_files();

  void changed();
  void check();
  void take(const CheckedDraft& checked);
  void show_rows();
  void show_row(int row);
  void show_frame(int row);
  void show_view_plate(int row);
  QPushButton* view_plate_button();
  void show_findings();
  /// Of the draft's image of this number, if it is still there.
  void set_view_plate(int number, const ViewPlate& plate);
  void create();

  std::shared_ptr<DraftChecker> checker_ = std::make_shared<DraftChecker>();
  CaseDraft draft_;
  int last_number_ = 0;  ///< of the draft's images
  CheckedDraft checked_;
  bool checking_ = false, again_ = false, writing_ = false, filling_ = false, own_folder_ = false;

  std::set<std::string> given_;  ///< views that have got the files of the chosen preset

  QComboBox *preset_ = nullptr, *calibrator_ = nullptr, *plate_ = nullptr;
  QPushButton *delete_preset_ = nullptr, *create_ = nullptr;
  QLineEdit *intensifier_ = nullptr, *folder_ = nullptr;
  QTableWidget* table_ = nullptr;
  QLabel *images_lack_ = nullptr, *calibrator_lacks_ = nullptr, *plate_lacks_ = nullptr,
         *folder_lacks_ = nullptr, *findings_ = nullptr;
};

}  // namespace helicarm::gui
