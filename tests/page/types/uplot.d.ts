// The plots come with declarations of their own, which are not kept here.
declare const uPlot: any;
export default uPlot;
