// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "helicarm/xray/dicom_elements.h"

namespace helicarm::xray::tags {

inline constexpr DicomTag meta_length{0x00020000, "File Meta Information Group Length"};
inline constexpr DicomTag transfer_syntax{0x00020010, "Transfer Syntax UID"};
inline constexpr DicomTag image_type{0x00080008, "Image Type"};
inline constexpr DicomTag sop_class{0x00080016, "SOP Class UID"};
inline constexpr DicomTag sop_instance{0x00080018, "SOP Instance UID"};
inline constexpr DicomTag acquisition_date{0x00080022, "Acquisition Date"};
inline constexpr DicomTag content_date{0x00080023, "Content Date"};
inline constexpr DicomTag acquisition_date_time{0x0008002A, "Acquisition DateTime"};
inline constexpr DicomTag acquisition_time{0x00080032, "Acquisition Time"};
inline constexpr DicomTag content_time{0x00080033, "Content Time"};
inline constexpr DicomTag modality{0x00080060, "Modality"};
inline constexpr DicomTag timezone{0x00080201, "Timezone Offset From UTC"};
inline constexpr DicomTag patient_name{0x00100010, "Patient's Name"};
inline constexpr DicomTag patient_id{0x00100020, "Patient ID"};
inline constexpr DicomTag source_detector{0x00181110, "Distance Source to Detector"};
inline constexpr DicomTag source_patient{0x00181111, "Distance Source to Patient"};
inline constexpr DicomTag imager_pixel_spacing{0x00181164, "Imager Pixel Spacing"};
inline constexpr DicomTag primary_angle{0x00181510, "Positioner Primary Angle"};
inline constexpr DicomTag secondary_angle{0x00181511, "Positioner Secondary Angle"};
inline constexpr DicomTag positioner_motion{0x00181500, "Positioner Motion"};
inline constexpr DicomTag primary_increment{0x00181520, "Positioner Primary Angle Increment"};
inline constexpr DicomTag secondary_increment{0x00181521, "Positioner Secondary Angle Increment"};
inline constexpr DicomTag field_rotation{0x00187032, "Field of View Rotation"};
inline constexpr DicomTag field_flip{0x00187034, "Field of View Horizontal Flip"};
inline constexpr DicomTag study{0x0020000D, "Study Instance UID"};
inline constexpr DicomTag series{0x0020000E, "Series Instance UID"};
inline constexpr DicomTag image_position{0x00200032, "Image Position (Patient)"};
inline constexpr DicomTag image_orientation{0x00200037, "Image Orientation (Patient)"};
inline constexpr DicomTag frame_of_reference{0x00200052, "Frame of Reference UID"};
inline constexpr DicomTag samples_per_pixel{0x00280002, "Samples per Pixel"};
inline constexpr DicomTag photometric{0x00280004, "Photometric Interpretation"};
inline constexpr DicomTag frames{0x00280008, "Number of Frames"};
inline constexpr DicomTag rows{0x00280010, "Rows"};
inline constexpr DicomTag columns{0x00280011, "Columns"};
inline constexpr DicomTag pixel_spacing{0x00280030, "Pixel Spacing"};
inline constexpr DicomTag pixel_aspect_ratio{0x00280034, "Pixel Aspect Ratio"};
inline constexpr DicomTag bits_allocated{0x00280100, "Bits Allocated"};
inline constexpr DicomTag bits_stored{0x00280101, "Bits Stored"};
inline constexpr DicomTag high_bit{0x00280102, "High Bit"};
inline constexpr DicomTag pixel_representation{0x00280103, "Pixel Representation"};
inline constexpr DicomTag rescale_intercept{0x00281052, "Rescale Intercept"};
inline constexpr DicomTag rescale_slope{0x00281053, "Rescale Slope"};
inline constexpr DicomTag intensity_relationship{0x00281040, "Pixel Intensity Relationship"};
inline constexpr DicomTag intensity_sign{0x00281041, "Pixel Intensity Relationship Sign"};
inline constexpr DicomTag lossy_compression{0x00282110, "Lossy Image Compression"};
inline constexpr DicomTag lut_shape{0x20500020, "Presentation LUT Shape"};
inline constexpr DicomTag shared_groups{0x52009229, "Shared Functional Groups Sequence"};
inline constexpr DicomTag frame_groups{0x52009230, "Per-Frame Functional Groups Sequence"};
inline constexpr DicomTag frame_content{0x00209111, "Frame Content Sequence"};
inline constexpr DicomTag frame_acquired{0x00189074, "Frame Acquisition DateTime"};
inline constexpr DicomTag frame_pixels{0x00289443, "Frame Pixel Data Properties Sequence"};
inline constexpr DicomTag field_of_view{0x00189432, "Field of View Sequence"};
inline constexpr DicomTag positioner_position{0x00189405, "Positioner Position Sequence"};
inline constexpr DicomTag xray_geometry{0x00189476, "X-Ray Geometry Sequence"};
inline constexpr DicomTag pixel_data{0x7FE00010, "Pixel Data"};

/// Exposure, body part, orientation and compression: codes and decimal numbers.
inline constexpr std::array technique = {DicomTag{0x00180015, "Body Part Examined"},
                                         DicomTag{0x00180060, "KVP"},
                                         DicomTag{0x00181150, "Exposure Time"},
                                         DicomTag{0x00181151, "X-Ray Tube Current"},
                                         DicomTag{0x00181152, "Exposure"},
                                         DicomTag{0x00181155, "Radiation Setting"},
                                         DicomTag{0x00185101, "View Position"},
                                         DicomTag{0x00187004, "Detector Type"},
                                         DicomTag{0x00200020, "Patient Orientation"},
                                         DicomTag{0x00200060, "Laterality"},
                                         DicomTag{0x00200062, "Image Laterality"},
                                         DicomTag{0x00280301, "Burned In Annotation"},
                                         DicomTag{0x00282110, "Lossy Image Compression"}};

/// Patient and General Study modules, with the character set of their text.
inline constexpr std::array patient_study = {DicomTag{0x00080005, "Specific Character Set"},
                                             DicomTag{0x00080020, "Study Date"},
                                             DicomTag{0x00080030, "Study Time"},
                                             DicomTag{0x00080050, "Accession Number"},
                                             DicomTag{0x00080090, "Referring Physician's Name"},
                                             DicomTag{0x00081030, "Study Description"},
                                             patient_name,
                                             patient_id,
                                             DicomTag{0x00100030, "Patient's Birth Date"},
                                             DicomTag{0x00100040, "Patient's Sex"},
                                             study,
                                             DicomTag{0x00200010, "Study ID"}};

}  // namespace helicarm::xray::tags
