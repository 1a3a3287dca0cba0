// SPDX-License-Identifier: Apache-2.0
#include <pcl/PCLPointCloud2.h>

#include <revisit/io/internal/scan_formats.hpp>
#include <revisit/io/point_cloud.hpp>

namespace revisit::io_internal {

// PCL's cloud has ROS's layout; its row_step is not always set.
Result<Scan> to_scan(const std::filesystem::path& file, const pcl::PCLPointCloud2& cloud, const LogSink& log) {
  PointCloudView view;
  for (const pcl::PCLPointField& field : cloud.fields)
    view.fields.push_back({field.name, field.offset, field.datatype});
  view.width = std::size_t{cloud.width} * cloud.height;
  view.point_step = cloud.point_step;
  view.data = {cloud.data.data(), cloud.data.size()};
  return revisit::to_scan(view, std::nullopt, file.string(), log);
}

}  // namespace revisit::io_internal
