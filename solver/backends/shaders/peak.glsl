// The largest size of all threads' values, as bits: those of positive floats are in the order of the floats, and NaN's
// are beyond. One atomic operation a group of threads.
layout(std430, binding = 1) buffer Peak { uint peak; };
shared uint group_peak;

void raise_peak(float value) {
    if (gl_LocalInvocationIndex == 0) group_peak = 0u;
    barrier();
    atomicMax(group_peak, floatBitsToUint(abs(value)));
    barrier();
    if (gl_LocalInvocationIndex == 0) atomicMax(peak, group_peak);
}
