// NOLINT(llvm-header-guard): it only takes back what Eigen says of the processor, in the middle of
// one of its classes. A matrix product then takes as many rows at a time as with SSE2.
#undef EIGEN_HAS_SINGLE_INSTRUCTION_MADD
