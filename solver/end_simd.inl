// Ends what solver/begin_avx2.inl or solver/begin_avx512.inl began.
#undef PARALLAX_LANES

#if defined(__clang__)
#pragma clang attribute pop
#else
#pragma GCC pop_options
#endif
