// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <functional>
#include <memory>
#include <stdexcept>
#include <string>

#include <dds/dds.h>

#include "ros2_messages.h"

/// Topics of ROS 2 over Cyclone DDS, without ROS 2.
namespace revisit::dds {

/// The descriptor that idlc made of each type.
template <typename Message>
const dds_topic_descriptor_t& descriptor_of();

// clang-format off
#define REVISIT_DDS_TYPE(Name, Generated)                                        \
  using Name = Generated;                                                        \
  template <> inline const dds_topic_descriptor_t& descriptor_of<Name>() { return Generated##_desc; }
REVISIT_DDS_TYPE(PointCloud2, sensor_msgs_msg_dds__PointCloud2_)
REVISIT_DDS_TYPE(ImuMessage, sensor_msgs_msg_dds__Imu_)
REVISIT_DDS_TYPE(NavSatFix, sensor_msgs_msg_dds__NavSatFix_)
REVISIT_DDS_TYPE(OdometryMessage, nav_msgs_msg_dds__Odometry_)
REVISIT_DDS_TYPE(EmptyMessage, std_msgs_msg_dds__Empty_)
REVISIT_DDS_TYPE(PathMessage, nav_msgs_msg_dds__Path_)
REVISIT_DDS_TYPE(PoseWithCovarianceStamped, geometry_msgs_msg_dds__PoseWithCovarianceStamped_)
REVISIT_DDS_TYPE(TfMessage, tf2_msgs_msg_dds__TFMessage_)
REVISIT_DDS_TYPE(DiagnosticArray, diagnostic_msgs_msg_dds__DiagnosticArray_)
REVISIT_DDS_TYPE(LoopMessage, revisit_ros_msg_dds__Loop_)
#undef REVISIT_DDS_TYPE
// clang-format on

/// What ROS 2 calls its profiles.
enum class Quality : std::uint8_t {
  kSensorData,  ///< best effort, the last 5
  kReliable,    ///< reliable, the last 100
  kLatched      ///< reliable; the last ones of a writer (one, or as many as it says) for those that come later, too
};

inline dds_entity_t require(dds_entity_t entity, const std::string& what) {
  if (entity < 0) throw std::runtime_error(what + ": " + dds_strretcode(entity));
  return entity;
}

inline std::unique_ptr<dds_qos_t, void (*)(dds_qos_t*)> qos_of(Quality quality, bool is_writer,
                                                               int latched_messages = 1) {
  std::unique_ptr<dds_qos_t, void (*)(dds_qos_t*)> qos(dds_create_qos(), dds_delete_qos);
  const bool is_reliable = quality != Quality::kSensorData, is_latched = quality == Quality::kLatched;
  constexpr int kReliableDepth = 100;
  const int depth = !is_reliable ? 5 : is_latched && is_writer ? latched_messages : kReliableDepth;
  dds_qset_reliability(qos.get(), is_reliable ? DDS_RELIABILITY_RELIABLE : DDS_RELIABILITY_BEST_EFFORT, DDS_MSECS(100));
  dds_qset_history(qos.get(), DDS_HISTORY_KEEP_LAST, depth);
  dds_qset_durability_service(qos.get(), 0, DDS_HISTORY_KEEP_LAST, depth, DDS_LENGTH_UNLIMITED, DDS_LENGTH_UNLIMITED,
                              DDS_LENGTH_UNLIMITED);  // what those get that come later
  dds_qset_durability(qos.get(), is_latched ? DDS_DURABILITY_TRANSIENT_LOCAL : DDS_DURABILITY_VOLATILE);
  return qos;
}

/// "/points" is "rt/points" on the wire.
template <typename Message>
dds_entity_t make_topic(dds_entity_t participant, const std::string& name) {
  const std::string on_wire = "rt" + (name.starts_with('/') ? name : "/" + name);
  return require(dds_create_topic(participant, &descriptor_of<Message>(), on_wire.c_str(), nullptr, nullptr), name);
}

template <typename Message>
class Writer {
 public:
  Writer(dds_entity_t participant, const std::string& name, Quality quality, int latched_messages = 1)
      : topic_(make_topic<Message>(participant, name)),
        writer_(require(dds_create_writer(participant, topic_, qos_of(quality, true, latched_messages).get(), nullptr),
                        name)) {}
  ~Writer() {
    dds_delete(writer_);
    dds_delete(topic_);
  }
  Writer(const Writer&) = delete;
  Writer& operator=(const Writer&) = delete;
  void write(const Message& message) const { (void)dds_write(writer_, &message); }

 private:
  dds_entity_t topic_, writer_;
};

/// Calls `use` with each message, from a thread of DDS. The message lives as long as the pointer.
template <typename Message>
class Reader {
 public:
  using Use = std::function<void(const std::shared_ptr<const Message>&)>;
  Reader(dds_entity_t participant, const std::string& name, Quality quality, Use use)
      : use_(std::move(use)), listener_(dds_create_listener(this), dds_delete_listener) {
    dds_lset_data_available(listener_.get(),
                            [](dds_entity_t reader, void* self) { static_cast<Reader*>(self)->take(reader); });
    reader_ = require(dds_create_reader(participant, make_topic<Message>(participant, name),
                                        qos_of(quality, false).get(), listener_.get()),
                      name);
  }
  ~Reader() { dds_delete(reader_); }
  Reader(const Reader&) = delete;
  Reader& operator=(const Reader&) = delete;

 private:
  void take(dds_entity_t reader) {
    while (true) {
      void* sample = nullptr;  // lent, and given back
      dds_sample_info_t info;
      if (dds_take(reader, &sample, &info, 1, 1) < 1) return;
      const std::shared_ptr<const Message> message(static_cast<const Message*>(sample), [reader](const Message* lent) {
        void* back = const_cast<Message*>(lent);
        dds_return_loan(reader, &back, 1);
      });
      if (info.valid_data) use_(message);
    }
  }

  Use use_;
  std::unique_ptr<dds_listener_t, void (*)(dds_listener_t*)> listener_;
  dds_entity_t reader_ = 0;
};

}  // namespace revisit::dds
