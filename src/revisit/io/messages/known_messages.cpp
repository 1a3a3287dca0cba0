// SPDX-License-Identifier: Apache-2.0
#include <map>

#include <revisit/io/internal/message_definition.hpp>

namespace revisit::io_internal {
namespace {

// The fields of the messages that revisit reads, for bags that embed no definitions. Constants are not read, but belong
// to what ROS 1 makes its checksums of.
const std::map<std::string, std::string, std::less<>>& definitions() {
  const std::string cloud = R"(Header header
uint32 height
uint32 width
PointField[] fields
bool is_bigendian
uint32 point_step
uint32 row_step
uint8[] data
bool is_dense
MSG: sensor_msgs/PointField
uint8 INT8=1
uint8 UINT8=2
uint8 INT16=3
uint8 UINT16=4
uint8 INT32=5
uint8 UINT32=6
uint8 FLOAT32=7
uint8 FLOAT64=8
string name
uint32 offset
uint8 datatype
uint32 count
)";
  const std::string livox = R"(Header header
uint64 timebase
uint32 point_num
uint8 lidar_id
uint8[3] rsvd
CustomPoint[] points
MSG: %s/CustomPoint
uint32 offset_time
float32 x
float32 y
float32 z
uint8 reflectivity
uint8 tag
uint8 line
)";
  const std::string geometry = R"(MSG: geometry_msgs/Vector3
float64 x
float64 y
float64 z
MSG: geometry_msgs/Point
float64 x
float64 y
float64 z
MSG: geometry_msgs/Quaternion
float64 x
float64 y
float64 z
float64 w
MSG: geometry_msgs/Pose
geometry_msgs/Point position
geometry_msgs/Quaternion orientation
MSG: geometry_msgs/PoseWithCovariance
geometry_msgs/Pose pose
float64[36] covariance
MSG: geometry_msgs/Twist
geometry_msgs/Vector3 linear
geometry_msgs/Vector3 angular
MSG: geometry_msgs/TwistWithCovariance
geometry_msgs/Twist twist
float64[36] covariance
MSG: geometry_msgs/Transform
geometry_msgs/Vector3 translation
geometry_msgs/Quaternion rotation
MSG: geometry_msgs/TransformStamped
Header header
string child_frame_id
geometry_msgs/Transform transform
)";
  const auto of = [](std::string text, const std::string& package) {
    return text.replace(text.find("%s"), 2, package);
  };
  static const std::map<std::string, std::string, std::less<>> kDefinitions = {
      {"sensor_msgs/PointCloud2", cloud},
      {"livox_ros_driver/CustomMsg", of(livox, "livox_ros_driver")},
      {"livox_ros_driver2/CustomMsg", of(livox, "livox_ros_driver2")},
      {"livox_interfaces/CustomMsg", of(livox, "livox_interfaces")},
      {"velodyne_msgs/VelodyneScan",
       "Header header\nVelodynePacket[] packets\nMSG: velodyne_msgs/VelodynePacket\ntime stamp\nuint8[1206] data\n"},
      {"pandar_msgs/PandarScan",
       "Header header\nPandarPacket[] packets\nMSG: pandar_msgs/PandarPacket\ntime stamp\nuint8[1500] data\nuint32 "
       "size\n"},
      {"ouster_ros/PacketMsg", "uint8[] buf\n"},
      {"ouster_sensor_msgs/PacketMsg", "uint8[] buf\n"},
      {"std_msgs/String", "string data\n"},
      {"nav_msgs/Odometry",
       "Header header\nstring child_frame_id\ngeometry_msgs/PoseWithCovariance pose\n"
       "geometry_msgs/TwistWithCovariance twist\n" +
           geometry},
      {"sensor_msgs/Imu",
       "Header header\ngeometry_msgs/Quaternion orientation\nfloat64[9] orientation_covariance\n"
       "geometry_msgs/Vector3 angular_velocity\nfloat64[9] angular_velocity_covariance\n"
       "geometry_msgs/Vector3 linear_acceleration\nfloat64[9] linear_acceleration_covariance\n" +
           geometry},
      {"tf2_msgs/TFMessage", "geometry_msgs/TransformStamped[] transforms\n" + geometry},
      {"tf/tfMessage", "geometry_msgs/TransformStamped[] transforms\n" + geometry},
      {"sensor_msgs/NavSatFix",
       "uint8 COVARIANCE_TYPE_UNKNOWN=0\nuint8 COVARIANCE_TYPE_APPROXIMATED=1\n"
       "uint8 COVARIANCE_TYPE_DIAGONAL_KNOWN=2\nuint8 COVARIANCE_TYPE_KNOWN=3\n"
       "Header header\nNavSatStatus status\nfloat64 latitude\nfloat64 longitude\nfloat64 altitude\n"
       "float64[9] position_covariance\nuint8 position_covariance_type\n"
       "MSG: sensor_msgs/NavSatStatus\nint8 STATUS_NO_FIX=-1\nint8 STATUS_FIX=0\nint8 STATUS_SBAS_FIX=1\n"
       "int8 STATUS_GBAS_FIX=2\nuint16 SERVICE_GPS=1\nuint16 SERVICE_GLONASS=2\nuint16 SERVICE_COMPASS=4\n"
       "uint16 SERVICE_GALILEO=8\nint8 status\nuint16 service\n"},
  };
  return kDefinitions;
}

}  // namespace

std::string known_definition(std::string_view short_type, bool is_ros1) {
  const auto found = definitions().find(short_type);
  if (found == definitions().end()) return {};
  return found->second + "MSG: std_msgs/Header\n" + (is_ros1 ? "uint32 seq\n" : "") + "time stamp\nstring frame_id\n";
}

const std::vector<std::string>& known_types() {
  static const std::vector<std::string> kTypes = [] {
    std::vector<std::string> types;
    for (const auto& [type, text] : definitions()) types.push_back(type);
    return types;
  }();
  return kTypes;
}

}  // namespace revisit::io_internal
