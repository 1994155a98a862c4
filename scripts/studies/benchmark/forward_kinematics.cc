// One joint placement after another with Pinocchio in C++: what softrobots.benchmark.cpp_kinematics times.
#include <pinocchio/algorithm/kinematics.hpp>
#include <pinocchio/multibody.hpp>

#include <string>

namespace {
struct Chain {
  pinocchio::Model model;
  pinocchio::Data data;
  Eigen::VectorXd q;
};
}  // namespace

extern "C" {

// Joints about or along the z axis of their frames, each on the one before.
// placements: 12 numbers a joint, rotation by rows and translation, in the frame of the joint before.
void* chain_new(int count, const int* slides, const double* placements) {
  Chain* chain = new Chain;
  for (int i = 0; i < count; ++i) {
    const double* p = placements + 12 * i;
    const Eigen::Matrix3d rotation = Eigen::Map<const Eigen::Matrix<double, 3, 3, Eigen::RowMajor>>(p);
    const pinocchio::SE3 placement(rotation, Eigen::Map<const Eigen::Vector3d>(p + 9));
    const std::string name = std::to_string(i + 1);
    if (slides[i]) {
      chain->model.addJoint(i, pinocchio::JointModelPZ(), placement, name);
    } else {
      chain->model.addJoint(i, pinocchio::JointModelRZ(), placement, name);
    }
  }
  chain->data = pinocchio::Data(chain->model);
  chain->q = Eigen::VectorXd::Zero(chain->model.nq);
  return chain;
}

// Placements of all joints for each of count configurations; last: where the last joint is, 3 numbers each.
void chain_forward(void* handle, int count, const double* q, double* last) {
  Chain* chain = static_cast<Chain*>(handle);
  const int size = static_cast<int>(chain->model.nq);
  for (int i = 0; i < count; ++i) {
    chain->q = Eigen::Map<const Eigen::VectorXd>(q + i * size, size);
    pinocchio::forwardKinematics(chain->model, chain->data, chain->q);
    Eigen::Map<Eigen::Vector3d>(last + 3 * i) = chain->data.oMi.back().translation();
  }
}

void chain_delete(void* handle) { delete static_cast<Chain*>(handle); }
}
