// Says the hash of what Eigen computes from random matrices of many sizes, compiled for whatever
// machine: products, decompositions and sums as the optimiser has them.

#include <Eigen/Cholesky>
#include <Eigen/Core>
#include <Eigen/Eigenvalues>
#include <Eigen/LU>
#include <Eigen/QR>
#include <bit>
#include <cstdint>
#include <cstdio>
#include <random>

namespace {

using Eigen::MatrixXd;
using Eigen::VectorXd;

std::uint64_t hash = 0xcbf29ce484222325;

void Note(const MatrixXd& numbers) {
  for (Eigen::Index i = 0; i < numbers.size(); ++i)
    hash = (hash ^ std::bit_cast<std::uint64_t>(numbers.data()[i])) * 0x100000001b3;
}

/// The standard lays down every bit of the engine, but none of its distributions.
MatrixXd Random(std::mt19937_64& random, int rows, int columns) {
  MatrixXd numbers(rows, columns);
  for (double& number : numbers.reshaped())
    number = static_cast<double>(random() >> 11) * 0x1p-53 - 0.5;
  return numbers;
}

}  // namespace

int main() {
  std::mt19937_64 random(7);
  for (int n = 1; n <= 40; ++n) {
    const MatrixXd A = Random(random, n + 3, n), B = Random(random, n, 2 * n);
    const VectorXd x = Random(random, n, 1), y = Random(random, n + 3, 1);
    Note(A * B);
    Note(A * x);
    Note(A.transpose() * y);
    const MatrixXd square = A.transpose() * A + 0.1 * MatrixXd::Identity(n, n);
    Note(square);
    Note(VectorXd::Constant(1, x.dot(square * x) + x.sum() + y.norm()));
    Note(square.ldlt().solve(x));
    Note(square.llt().solve(x));
    Note(square.partialPivLu().solve(x));
    Note(A.colPivHouseholderQr().solve(y));
    const Eigen::SelfAdjointEigenSolver<MatrixXd> eigen(square);
    Note(eigen.eigenvalues());
    Note(eigen.eigenvectors() * x.asDiagonal() * eigen.eigenvectors().transpose());
    Note(square + x * x.transpose() / 3);
  }
  std::printf("%016llx\n", static_cast<unsigned long long>(hash));
}
