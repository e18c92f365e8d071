// Sums over the threads of a group.
shared int sums[GROUP];

// The sum of the values of all threads up to this one.
int sum_up_to(int value)
{
    int thread = int(gl_LocalInvocationIndex);
    sums[thread] = value;
    for (int reach = 1; reach < GROUP; reach *= 2) {
        barrier();
        int before = thread >= reach ? sums[thread - reach] : 0;
        barrier();
        sums[thread] += before;
    }
    barrier();
    return sums[thread];
}
